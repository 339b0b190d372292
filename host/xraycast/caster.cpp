#include "xraycast/caster.hpp"

#include "xraycast/device_cylinder.hpp"
#include "xraycast/device_opacity.hpp"

namespace xraycast {

CastResult cast(const ResidentScan& scan, const MapGeometry& geometry, const Opacity& opacity,
                Progress& progress) {
  const DeviceCylinder cylinder(scan, geometry);
  Device& device = scan.device();
  const DeviceOpacity device_opacity(device, opacity);
  CastResult result{{geometry, opacity, {}, {}}};
  result.map.tau.resize(static_cast<std::size_t>(geometry.layers()) * result.map.layer_size());
  cl::Buffer tau =
      device.buffer(CL_MEM_WRITE_ONLY, static_cast<std::int64_t>(result.map.tau.size() * sizeof(float)));

  cl::Kernel kernel =
      device.kernel("cylinder", "cast_cylinder", device_opacity.build_options() + scan.build_options());
  kernel.setArg(0, scan.voxels());
  kernel.setArg(1, scan.layout());
  kernel.setArg(2, cylinder.parameters());
  kernel.setArg(3, cylinder.directions());
  kernel.setArg(4, cylinder.shells());
  kernel.setArg(5, device_opacity.parameters());
  kernel.setArg(6, device_opacity.table());
  kernel.setArg(7, tau);
  progress.begin("casting", geometry.height, "slices");
  const std::int64_t items =
      (geometry.height + scan.slices_per_item() - 1) / scan.slices_per_item();
  // On a processor, vectors run along the slices and a group of one item is best.
  const std::int64_t group = scan.slices_per_item() > 1 ? 1 : 64;
  const cl::Event done = device.run(kernel, {geometry.width, items, 1}, {group, 1, 1});
  device.download(tau, std::span(result.map.tau));
  result.kernel_ms = duration_ms(done);
  progress.advance(geometry.height);
  return result;
}

}  // namespace xraycast
