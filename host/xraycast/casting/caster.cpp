#include "xraycast/casting/caster.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/casting/device_rays.hpp"
#include "xraycast/opencl/device_opacity.hpp"
#include "xraycast/projection/projector.hpp"

namespace xraycast {
namespace {

struct Rows {
  int first, count;
};

cl::Event run_sphere(ComputeDevice& device, const cl::Kernel& kernel, int width, const Rows& rows) {
  return device.run(kernel, {width, rows.count, 1}, {64, 1, 1}, {0, rows.first, 0});
}

/// Whole bricks, each in parts of `slices`. On a processor vectors run along the slices, and a group of one
/// item is best; on a GPU neighbours share what they read: the parts of a brick, for some angles.
cl::Event run_cylinder(ComputeDevice& device, const cl::Kernel& kernel, const MapGeometry& geometry,
                       const Rows& rows, int slices) {
  constexpr int kBrick = XRC_BRICK_SLICES, kAngles = 8;
  const int first_slice = geometry.height - rows.first - rows.count, end = first_slice + rows.count;
  const int first = first_slice / kBrick, bricks = (end + kBrick - 1) / kBrick - first,
            parts = kBrick / slices;
  return device.run(kernel, {parts, geometry.width, bricks}, {parts, slices == kBrick ? 1 : kAngles, 1},
                    {0, 0, first});
}

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
  const Rows rows = moved ? Rows{moved->first, moved->count} : Rows{0, geometry.height};
  const cl::Event done = is_sphere ? run_sphere(device, kernel, geometry.width, rows)
                                   : run_cylinder(device, kernel, geometry, rows, rays.slices_per_item());
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
