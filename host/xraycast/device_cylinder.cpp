#include "xraycast/device_cylinder.hpp"

#include "xraycast/error.hpp"

#include <cmath>
#include <vector>

namespace xraycast {
namespace {

static_assert(sizeof(XrcShell) == 16);
static_assert(sizeof(XrcCylinder) == 36);

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

XrcCylinder parameters_of(const VolumeGeometry& volume, const MapGeometry& geometry) {
  const glm::dvec3 centre = volume.to_index({geometry.centre_mm[0], volume.origin_mm.z});
  XrcCylinder parameters{};
  parameters.width = geometry.width;
  parameters.height = geometry.height;
  parameters.layers = geometry.layers();
  parameters.samples = static_cast<int>(std::ceil(on_grid(geometry.radius_mm() / geometry.step_mm)));
  parameters.step_mm = static_cast<float>(geometry.step_mm);
  parameters.step_x = static_cast<float>(geometry.step_mm / volume.spacing_mm.x);
  parameters.step_y = static_cast<float>(geometry.step_mm / volume.spacing_mm.y);
  parameters.centre_x = static_cast<float>(centre.x);
  parameters.centre_y = static_cast<float>(centre.y);
  return parameters;
}

}  // namespace

DeviceCylinder::DeviceCylinder(const ResidentScan& scan, const MapGeometry& geometry) {
  validate(geometry, "map");
  if (geometry.height != scan.geometry().size.z || geometry.centre_mm.size() != 1)
    throw InputError("a map of {} rows does not belong to a scan of {} slices", geometry.height,
                     scan.geometry().size.z);
  Device& device = scan.device();
  parameters_ = parameters_of(scan.geometry(), geometry);
  directions_ = device.upload(std::span<const Direction>(directions_of(geometry)));
  shells_ = device.upload(std::span<const XrcShell>(shells_of(geometry)));
}

}  // namespace xraycast
