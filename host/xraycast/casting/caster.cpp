#include "xraycast/casting/caster.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/casting/device_rays.hpp"
#include "xraycast/opencl/device_opacity.hpp"
#include "xraycast/projection/projector.hpp"

namespace xraycast {
namespace {

/// Cylinders and spheres.
CastResult cast_shells(const ResidentScan& scan, const MapGeometry& geometry, const Opacity& opacity,
                       Progress& progress, const MovedRows* moved) {
  const DeviceRays rays(scan, geometry);
  ComputeDevice& device = scan.device();
  const DeviceOpacity device_opacity(device, opacity);
  CastResult result{{geometry, opacity, {}, {}}};
  result.map.tau.resize(static_cast<std::size_t>(geometry.layers()) * result.map.layer_size());
  const cl::Buffer tau =
      device.buffer(CL_MEM_WRITE_ONLY, static_cast<std::int64_t>(result.map.tau.size() * sizeof(float)));

  constexpr unsigned kFirstOfMoved = 10;  // of the kernels' arguments
  const bool is_sphere = geometry.ray_layout == RayLayout::sphere;
  cl::Kernel kernel = device.kernel(
      is_sphere ? "sphere" : "cylinder", is_sphere ? "cast_sphere" : "cast_cylinder",
      device_opacity.build_options() + rays.build_options() + (moved ? moved->field.build_options() : ""));
  const auto set = [&](const auto& map, const cl::Buffer& of_rows) {
    set_args(kernel, scan.voxels(), scan.layout(), map, of_rows, rays.azimuths(), rays.scales(),
             rays.shells(), device_opacity.parameters(), device_opacity.table(), tau);
  };
  if (is_sphere)
    set(rays.sphere(), rays.polars());
  else
    set(rays.cylinder(), rays.centres());
  if (moved) moved->field.set_args(kernel, kFirstOfMoved);
  progress.begin("casting", geometry.height, "rows");
  const int slices = rays.slices_per_item();
  int first = 0, end = geometry.height;  // rows of a sphere, slices of a cylinder
  if (moved) {
    first = is_sphere ? moved->first : geometry.height - moved->first - moved->count;
    end = first + moved->count;
  }
  const int first_run = first / slices, runs = (end + slices - 1) / slices - first_run;
  // On a processor, vectors run along the slices and a group of one item is best.
  const cl::Event done =
      device.run(kernel, {geometry.width, runs, 1}, {slices > 1 ? 1 : 64, 1, 1}, {0, first_run, 0});
  device.download(tau, std::span(result.map.tau));
  result.kernel_ms = duration_ms(done);
  progress.advance(geometry.height);
  return result;
}

/// One parallel picture per view, by the projector, limited to the map's radius.
CastResult cast_rectangles(const ResidentScan& scan, const MapGeometry& geometry, const Opacity& opacity,
                           Progress& progress) {
  validate(geometry, "map");
  CastResult result{{geometry, opacity, {}, {}}};
  View view;
  view.width = geometry.width;
  view.height = geometry.height;
  view.pixel_mm = geometry.row_spacing_mm;
  view.centre_mm = {geometry.centre_mm[0], geometry.z_mm(0.5 * (geometry.height - 1))};
  const BodyOutline within{geometry.centre_mm[0], geometry.radius_mm()};
  progress.begin("casting", geometry.views, "views");
  for (int k = 0; k < geometry.views; ++k) {
    view.lao_rad = geometry.view_rad(k);
    Progress one;  // the whole map's progress is reported here
    const ProjectionImage image = project(scan, view, opacity, one, within);
    result.map.tau.insert(result.map.tau.end(), image.tau.begin(), image.tau.end());
    result.kernel_ms += image.kernel_ms;
    progress.advance();
  }
  return result;
}

}  // namespace

CastResult cast(const ResidentScan& scan, const MapGeometry& geometry, const Opacity& opacity,
                Progress& progress, const MovedRows* moved) {
  if (geometry.ray_layout != RayLayout::rectangle)
    return cast_shells(scan, geometry, opacity, progress, moved);
  if (moved) throw InputError("a rectangle map cannot be cast through a moving scan; cast a cylinder");
  return cast_rectangles(scan, geometry, opacity, progress);
}

}  // namespace xraycast
