#include "xraycast/caster.hpp"

#include "xraycast/device_opacity.hpp"
#include "xraycast/error.hpp"
#include "xraycast/projector.hpp"

#include <array>
#include <cmath>

namespace xraycast {
namespace {

static_assert(sizeof(XrcShell) == 16);
static_assert(sizeof(XrcCylinder) == 28);
static_assert(sizeof(XrcSphere) == 44);

struct Direction {
  float sine, cosine;
};

/// Of `count` angles, on the device.
template <typename AngleOf>
cl::Buffer upload_directions(Device& device, int count, const AngleOf& angle_of) {
  std::vector<Direction> directions;
  for (int i = 0; i < count; ++i) {
    const double angle = angle_of(i);
    directions.push_back({static_cast<float>(std::sin(angle)), static_cast<float>(std::cos(angle))});
  }
  return device.upload(std::span<const Direction>(directions));
}

cl::Buffer upload_azimuths(Device& device, const MapGeometry& geometry) {
  return upload_directions(device, geometry.width, [&](int column) { return geometry.phi_rad(column); });
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

int samples_of(const MapGeometry& geometry) {
  return static_cast<int>(std::ceil(on_grid(geometry.radius_mm() / geometry.step_mm)));
}

/// Every slice's centre in voxels, the most inferior slice first.
cl::Buffer upload_centres(Device& device, const MapGeometry& geometry, const VolumeGeometry& volume) {
  std::vector<std::array<float, 2>> centres;
  for (int z = 0; z < geometry.height; ++z) {
    const glm::dvec2 centre_mm = geometry.centre_of_row_mm(geometry.height - 1 - z);
    const glm::dvec3 centre = volume.to_index({centre_mm, volume.origin_mm.z});
    centres.push_back({static_cast<float>(centre.x), static_cast<float>(centre.y)});
  }
  return device.upload(std::span<const std::array<float, 2>>(centres));
}

void check_belongs(const ResidentScan& scan, const MapGeometry& geometry) {
  validate(geometry, "map");
  if (geometry.projection == Projection::cylinder && geometry.height != scan.geometry().size.z)
    throw InputError("a map of {} rows does not belong to a scan of {} slices", geometry.height,
                     scan.geometry().size.z);
}

cl::Event enqueue_cylinder(const ResidentScan& scan, const MapGeometry& geometry,
                           const DeviceOpacity& opacity, const cl::Buffer& shells, const cl::Buffer& tau) {
  Device& device = scan.device();
  const VolumeGeometry& volume = scan.geometry();
  XrcCylinder parameters{};
  parameters.width = geometry.width;
  parameters.height = geometry.height;
  parameters.layers = geometry.layers();
  parameters.samples = samples_of(geometry);
  parameters.step_mm = static_cast<float>(geometry.step_mm);
  parameters.step_x = static_cast<float>(geometry.step_mm / volume.spacing_mm.x);
  parameters.step_y = static_cast<float>(geometry.step_mm / volume.spacing_mm.y);
  // Named, because a kernel's argument does not keep a buffer alive until it is enqueued.
  const cl::Buffer centres = upload_centres(device, geometry, volume),
                   azimuths = upload_azimuths(device, geometry);
  const bool one_slice = geometry.centre_mm.size() > 1;
  const int slices = one_slice ? 1 : scan.slices_per_item();

  cl::Kernel kernel =
      device.kernel("cylinder", "cast_cylinder",
                    opacity.build_options() + scan.build_options() + (one_slice ? " -DONE_SLICE" : ""));
  kernel.setArg(0, scan.voxels());
  kernel.setArg(1, scan.layout());
  kernel.setArg(2, parameters);
  kernel.setArg(3, centres);
  kernel.setArg(4, azimuths);
  kernel.setArg(5, shells);
  kernel.setArg(6, opacity.parameters());
  kernel.setArg(7, opacity.table());
  kernel.setArg(8, tau);
  // On a processor, vectors run along the slices and a group of one item is best.
  const std::int64_t group = slices > 1 ? 1 : 64;
  return device.run(kernel, {geometry.width, (volume.size.z + slices - 1) / slices, 1}, {group, 1, 1});
}

cl::Event enqueue_sphere(const ResidentScan& scan, const MapGeometry& geometry, const DeviceOpacity& opacity,
                         const cl::Buffer& shells, const cl::Buffer& tau) {
  Device& device = scan.device();
  const VolumeGeometry& volume = scan.geometry();
  XrcSphere parameters{};
  parameters.width = geometry.width;
  parameters.height = geometry.height;
  parameters.layers = geometry.layers();
  parameters.samples = samples_of(geometry);
  parameters.step_mm = static_cast<float>(geometry.step_mm);
  const cl::Buffer azimuths = upload_azimuths(device, geometry);
  const cl::Buffer polars =
      upload_directions(device, geometry.height, [&](int row) { return geometry.theta_rad(row); });
  const glm::dvec3 centre = volume.to_index({geometry.centre_mm[0], geometry.centre_z_mm});
  for (int axis = 0; axis < 3; ++axis) {
    parameters.centre[axis] = static_cast<float>(centre[axis]);
    parameters.step[axis] = static_cast<float>(geometry.step_mm / volume.spacing_mm[axis]);
  }

  cl::Kernel kernel = device.kernel("sphere", "cast_sphere", opacity.build_options() + scan.build_options());
  kernel.setArg(0, scan.voxels());
  kernel.setArg(1, scan.layout());
  kernel.setArg(2, parameters);
  kernel.setArg(3, azimuths);
  kernel.setArg(4, polars);
  kernel.setArg(5, shells);
  kernel.setArg(6, opacity.parameters());
  kernel.setArg(7, opacity.table());
  kernel.setArg(8, tau);
  return device.run(kernel, {geometry.width, geometry.height, 1}, {64, 1, 1});
}

/// One parallel picture a view, by the projector.
CastResult cast_rectangles(const ResidentScan& scan, const MapGeometry& geometry, const Opacity& opacity,
                           Progress& progress) {
  CastResult result{{geometry, opacity, {}, {}}};
  View view;
  view.width = geometry.width;
  view.height = geometry.height;
  view.pixel_mm = geometry.row_spacing_mm;
  view.centre_mm = {geometry.centre_mm[0], geometry.z_mm(0.5 * (geometry.height - 1))};
  progress.begin("casting", geometry.views, "views");
  for (int k = 0; k < geometry.views; ++k) {
    view.angle_rad = geometry.view_rad(k);
    Progress one;  // the whole map's is ours
    const ProjectionImage image = project(scan, view, opacity, one);
    result.map.tau.insert(result.map.tau.end(), image.tau.begin(), image.tau.end());
    result.kernel_ms += image.kernel_ms;
    progress.advance();
  }
  return result;
}

}  // namespace

CastResult cast(const ResidentScan& scan, const MapGeometry& geometry, const Opacity& opacity,
                Progress& progress) {
  check_belongs(scan, geometry);
  if (geometry.projection == Projection::rectangle) return cast_rectangles(scan, geometry, opacity, progress);

  Device& device = scan.device();
  const DeviceOpacity device_opacity(device, opacity);
  const cl::Buffer shells = device.upload(std::span<const XrcShell>(shells_of(geometry)));
  CastResult result{{geometry, opacity, {}, {}}};
  result.map.tau.resize(static_cast<std::size_t>(geometry.layers()) * result.map.layer_size());
  const cl::Buffer tau =
      device.buffer(CL_MEM_WRITE_ONLY, static_cast<std::int64_t>(result.map.tau.size() * sizeof(float)));
  progress.begin("casting", geometry.height, "rows");
  const auto enqueue = geometry.projection == Projection::sphere ? enqueue_sphere : enqueue_cylinder;
  const cl::Event done = enqueue(scan, geometry, device_opacity, shells, tau);
  device.download(tau, std::span(result.map.tau));
  result.kernel_ms = duration_ms(done);
  progress.advance(geometry.height);
  return result;
}

}  // namespace xraycast
