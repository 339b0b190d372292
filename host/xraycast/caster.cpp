#include "xraycast/caster.hpp"

#include "xraycast/device_opacity.hpp"
#include "xraycast/error.hpp"

#include <cmath>

namespace xraycast {
namespace {

static_assert(sizeof(XrcShell) == 16);
static_assert(sizeof(XrcCylinder) == 28);

struct Direction {
  float sine, cosine;
};

std::vector<Direction> directions_of(const MapGeometry& geometry) {
  std::vector<Direction> directions;
  for (int column = 0; column < geometry.width; ++column) {
    const double phi = geometry.phi_rad(column);
    directions.push_back({static_cast<float>(std::sin(phi)), static_cast<float>(std::cos(phi))});
  }
  return directions;
}

/// Edges in units of a step. One that meets the sample grid but for rounding is put on it.
double on_grid(double edge) {
  return std::abs(edge - std::round(edge)) < 1e-9 * (1 + edge) ? std::round(edge) : edge;
}

std::vector<XrcShell> shells_of(const MapGeometry& geometry) {
  const double step_mm = geometry.step_mm;
  std::vector<XrcShell> shells;
  for (int k = 0; k < geometry.layers(); ++k) {
    const double inner = on_grid(geometry.radii_mm[k] / step_mm),
                 outer = on_grid(geometry.radii_mm[k + 1] / step_mm);
    const double first = std::ceil(inner), last = std::floor(outer);
    XrcShell shell{static_cast<int>(first), static_cast<int>(last), 0, 0};
    if (last < first) {  // both edges in one sample
      shell.last = shell.first;
      shell.head_mm = static_cast<float>((outer - inner) * step_mm);
    } else {
      shell.head_mm = static_cast<float>((first - inner) * step_mm);
      shell.tail_mm = static_cast<float>((outer - last) * step_mm);
    }
    shells.push_back(shell);
  }
  return shells;
}

void check_belongs(const ResidentScan& scan, const MapGeometry& geometry) {
  validate(geometry, "map");
  if (geometry.height != scan.geometry().size.z || geometry.centre_mm.size() != 1)
    throw InputError("a map of {} rows does not belong to a scan of {} slices", geometry.height,
                     scan.geometry().size.z);
}

}  // namespace

CastResult cast(const ResidentScan& scan, const MapGeometry& geometry, const Opacity& opacity,
                Progress& progress) {
  check_belongs(scan, geometry);
  Device& device = scan.device();
  const VolumeGeometry& volume = scan.geometry();

  const DeviceOpacity device_opacity(device, opacity);
  const cl::Buffer directions = device.upload(std::span<const Direction>(directions_of(geometry)));
  const cl::Buffer shells = device.upload(std::span<const XrcShell>(shells_of(geometry)));
  CastResult result{{geometry, opacity, {}, {}}};
  result.map.tau.resize(static_cast<std::size_t>(geometry.layers()) * result.map.layer_size());
  cl::Buffer tau =
      device.buffer(CL_MEM_WRITE_ONLY, static_cast<std::int64_t>(result.map.tau.size() * sizeof(float)));

  XrcCylinder parameters{};
  parameters.width = geometry.width;
  parameters.height = geometry.height;
  parameters.layers = geometry.layers();
  parameters.samples = static_cast<int>(std::ceil(on_grid(geometry.radius_mm() / geometry.step_mm)));
  parameters.step_mm = static_cast<float>(geometry.step_mm);
  parameters.step_x = static_cast<float>(geometry.step_mm / volume.spacing_mm.x);
  parameters.step_y = static_cast<float>(geometry.step_mm / volume.spacing_mm.y);
  const glm::dvec3 centre = volume.to_index({geometry.centre_mm[0], volume.origin_mm.z});

  cl::Kernel kernel =
      device.kernel("cylinder", "cast_cylinder", device_opacity.build_options() + scan.build_options());
  kernel.setArg(0, scan.voxels());
  kernel.setArg(1, scan.layout());
  kernel.setArg(2, parameters);
  kernel.setArg(3, static_cast<float>(centre.x));
  kernel.setArg(4, static_cast<float>(centre.y));
  kernel.setArg(5, directions);
  kernel.setArg(6, shells);
  kernel.setArg(7, device_opacity.parameters());
  kernel.setArg(8, device_opacity.table());
  kernel.setArg(9, tau);
  progress.begin("casting", geometry.height, "slices");
  const std::int64_t items = (volume.size.z + scan.slices_per_item() - 1) / scan.slices_per_item();
  // On a processor, vectors run along the slices and a group of one item is best.
  const std::int64_t group = scan.slices_per_item() > 1 ? 1 : 64;
  const cl::Event done = device.run(kernel, {geometry.width, items, 1}, {group, 1, 1});
  device.download(tau, std::span(result.map.tau));
  result.kernel_ms = duration_ms(done);
  progress.advance(geometry.height);
  return result;
}

}  // namespace xraycast
