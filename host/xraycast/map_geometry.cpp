#include "xraycast/map_geometry.hpp"

#include "xraycast/error.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

constexpr int kMaxAngles = 16384;
constexpr int kMaxLayers = 256;
constexpr double kMaxRadius_mm = 1e5;

}  // namespace

std::string to_string(Projection projection) {
  switch (projection) {
    case Projection::cylinder:
      return "cylinder";
  }
  return {};
}

std::vector<double> shell_radii_mm(RadiiRule rule, int layers, double radius_mm) {
  if (layers < 1 || layers > kMaxLayers)
    throw InputError("layers is {}, but has to be 1 to {}", layers, kMaxLayers);
  if (!std::isfinite(radius_mm) || radius_mm <= 0)
    throw InputError("radius is {} mm, but has to be above 0", radius_mm);
  std::vector<double> radii;
  for (int k = 0; k <= layers; ++k) {
    const double share = static_cast<double>(k) / layers;
    radii.push_back(radius_mm * (rule == RadiiRule::equal_area ? std::sqrt(share) : share));
  }
  return radii;
}

double MapGeometry::phi_rad(double column) const { return (column + 0.5) * 2 * std::numbers::pi / width; }

MapGeometry cylinder_map(const VolumeGeometry& volume, int angles, std::vector<double> radii_mm,
                         glm::dvec2 centre_mm) {
  const glm::dvec3 lower = volume.lower_mm(), upper = volume.upper_mm();
  if (!(centre_mm.x >= lower.x && centre_mm.x <= upper.x && centre_mm.y >= lower.y && centre_mm.y <= upper.y))
    throw InputError(
        "the centre ({:g}, {:g}) mm lies outside the scan, which spans {:.1f} to {:.1f} mm in x and {:.1f} "
        "to {:.1f} mm in y",
        centre_mm.x, centre_mm.y, lower.x, upper.x, lower.y, upper.y);
  MapGeometry map;
  map.width = angles;
  map.height = static_cast<int>(volume.size.z);
  map.radii_mm = std::move(radii_mm);
  map.centre_mm = {centre_mm};
  map.top_mm = volume.origin_mm.z + static_cast<double>(volume.size.z - 1) * volume.spacing_mm.z;
  map.row_spacing_mm = volume.spacing_mm.z;
  if (!map.radii_mm.empty()) {
    const double pixel_mm = std::min(volume.spacing_mm.x, volume.spacing_mm.y);
    map.step_mm = map.radius_mm() / std::max(1.0, std::ceil(map.radius_mm() / pixel_mm));
  }
  validate(map, "map");
  return map;
}

void validate(const MapGeometry& geometry, const std::string& name) {
  if (geometry.width < 1 || geometry.width > kMaxAngles)
    throw InputError("{}: {} angles, but there have to be 1 to {}", name, geometry.width, kMaxAngles);
  if (geometry.height < 1 || geometry.height > 65536)
    throw InputError("{}: height is {}", name, geometry.height);
  if (geometry.layers() < 1 || geometry.layers() > kMaxLayers)
    throw InputError("{}: {} radii, but there have to be 2 to {}", name, geometry.radii_mm.size(),
                     kMaxLayers + 1);
  for (std::size_t k = 0; k < geometry.radii_mm.size(); ++k) {
    const double radius = geometry.radii_mm[k];
    if (!(radius >= 0 && radius <= kMaxRadius_mm))
      throw InputError("{}: radii[{}] is {} mm, outside 0 to {}", name, k, radius, kMaxRadius_mm);
    if (k > 0 && radius <= geometry.radii_mm[k - 1])
      throw InputError("{}: radii[{}] of {:g} mm does not exceed the one before it, {:g} mm", name, k, radius,
                       geometry.radii_mm[k - 1]);
  }
  if (geometry.centre_mm.size() != 1 &&
      geometry.centre_mm.size() != static_cast<std::size_t>(geometry.height))
    throw InputError("{}: {} centres for {} rows", name, geometry.centre_mm.size(), geometry.height);
  for (const glm::dvec2& centre : geometry.centre_mm)
    if (!std::isfinite(centre.x) || !std::isfinite(centre.y))
      throw InputError("{}: a centre is not finite", name);
  if (!std::isfinite(geometry.top_mm) || !std::isfinite(geometry.row_spacing_mm) ||
      geometry.row_spacing_mm <= 0)
    throw InputError("{}: top or row spacing is not usable", name);
  if (!(geometry.step_mm > 0) || !(geometry.radius_mm() / geometry.step_mm < 1e6))
    throw InputError("{}: step of {} mm is not usable", name, geometry.step_mm);
}

}  // namespace xraycast
