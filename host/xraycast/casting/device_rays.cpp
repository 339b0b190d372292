#include "xraycast/casting/device_rays.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/casting/outline_bands.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace xraycast {
namespace {

static_assert(sizeof(XrcShell) == 16);
static_assert(sizeof(XrcCylinder) == 32);
static_assert(sizeof(XrcSphere) == 48);

using Pair = std::array<float, 2>;

/// Sine and cosine of `count` angles.
template <typename AngleOf>
cl::Buffer upload_directions(ComputeDevice& device, int count, const AngleOf& angle_of) {
  std::vector<Pair> directions;
  for (int i = 0; i < count; ++i) {
    const double angle = angle_of(i);
    directions.push_back({static_cast<float>(std::sin(angle)), static_cast<float>(std::cos(angle))});
  }
  return device.upload(std::span<const Pair>(directions));
}

/// Every slice's centre in voxels, the most inferior slice first.
cl::Buffer upload_centres(ComputeDevice& device, const MapGeometry& geometry, const VolumeGeometry& volume) {
  std::vector<Pair> centres;
  for (int z = 0; z < geometry.height; ++z) {
    const glm::dvec2 centre_mm = geometry.centre_of_row_mm(geometry.height - 1 - z);
    const glm::dvec3 centre = volume.to_index({centre_mm, volume.origin_mm.z});
    centres.push_back({static_cast<float>(centre.x), static_cast<float>(centre.y)});
  }
  return device.upload(std::span<const Pair>(centres));
}

/// Edges in units of a step. An edge on the sample grid up to rounding is snapped to it.
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

XrcMap map_of(const MapGeometry& geometry) {
  const auto samples = static_cast<int>(std::ceil(on_grid(geometry.radius_mm() / geometry.step_mm)));
  return {geometry.width,
          geometry.height,
          geometry.layers(),
          samples,
          static_cast<float>(geometry.step_mm),
          scale_stride(geometry)};
}

}  // namespace

DeviceRays::DeviceRays(const ResidentScan& scan, const MapGeometry& geometry)
    : scan_(scan), geometry_(geometry) {
  validate(geometry, "map");
  if (geometry.ray_layout == RayLayout::rectangle) throw InputError("a rectangle map has no shells");
  if (geometry.ray_layout == RayLayout::cylinder && geometry.height != scan.geometry().size.z)
    throw InputError(
        "a map of {} rows does not match a scan of {} slices; give the scan that it was cast from",
        geometry.height, scan.geometry().size.z);
  ComputeDevice& device = scan.device();
  azimuths_ = upload_directions(device, geometry.width, [&](int column) { return geometry.phi_rad(column); });
  scales_ = upload_scales(device, geometry);
  shells_ = device.upload(std::span<const XrcShell>(shells_of(geometry)));
  if (geometry.ray_layout == RayLayout::cylinder)
    centres_ = upload_centres(device, geometry, scan.geometry());
  else
    polars_ = upload_directions(device, geometry.height, [&](int row) { return geometry.theta_rad(row); });
}

XrcCylinder DeviceRays::cylinder() const {
  const glm::vec2 step(geometry_.step_mm / glm::dvec2(scan_.geometry().spacing_mm));
  return {map_of(geometry_), step.x, step.y};
}

XrcSphere DeviceRays::sphere() const {
  const glm::dvec3 centre = scan_.geometry().to_index({geometry_.centre_mm[0], geometry_.centre_z_mm});
  XrcSphere parameters{map_of(geometry_), {}, {}};
  for (int axis = 0; axis < 3; ++axis) {
    parameters.centre[axis] = static_cast<float>(centre[axis]);
    parameters.step[axis] = static_cast<float>(geometry_.step_mm / scan_.geometry().spacing_mm[axis]);
  }
  return parameters;
}

bool DeviceRays::has_rows_alike() const {
  // Bands of rows that share an outline may end between the slices of two items, which are counted from
  // below.
  return geometry_.centre_mm.size() == 1 &&
         std::ranges::all_of(outline_bands(geometry_), [&](const auto& band) {
           return (geometry_.height - band.first_row) % scan_.slices_per_item() == 0 || band.first_row == 0;
         });
}

int DeviceRays::slices_per_item() const { return has_rows_alike() ? scan_.slices_per_item() : 1; }

std::string DeviceRays::build_options() const {
  return geometry_.ray_layout == RayLayout::sphere ? "" : fmt::format(" -DSLICES={}", slices_per_item());
}

cl::Buffer upload_scales(ComputeDevice& device, const MapGeometry& geometry) {
  std::vector<float> scales;
  for (int row = 0; row < (geometry.has_plane_outline() ? 1 : geometry.height); ++row)
    for (int column = 0; column < geometry.width; ++column)
      scales.push_back(static_cast<float>(geometry.scale(column, row)));
  return device.upload(std::span<const float>(scales));
}

int scale_stride(const MapGeometry& geometry) { return geometry.has_plane_outline() ? 0 : geometry.width; }

}  // namespace xraycast
