#include "xraycast/casting/map_geometry.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

constexpr int kMaxAngles = 16384;
constexpr int kMaxViews = 3600;
constexpr double kMaxRadius_mm = 1e5;

void check_within(const VolumeGeometry& volume, const glm::dvec3& centre_mm) {
  const glm::dvec3 lower = volume.lower_mm(), upper = volume.upper_mm();
  const auto within = [&](int axis) {
    return centre_mm[axis] >= lower[axis] && centre_mm[axis] <= upper[axis];
  };
  if (!within(0) || !within(1) || !within(2))
    throw InputError(
        "the centre ({:g}, {:g}, {:g}) mm lies outside the scan, which spans {:.1f} to {:.1f} mm in x, "
        "{:.1f} to {:.1f} mm in y and {:.1f} to {:.1f} mm in z",
        centre_mm.x, centre_mm.y, centre_mm.z, lower.x, upper.x, lower.y, upper.y, lower.z, upper.z);
}

/// Common to maps with one row per slice.
MapGeometry map_of_slices(const VolumeGeometry& volume) {
  MapGeometry map;
  map.height = static_cast<int>(volume.size.z);
  map.top_mm = volume.origin_mm.z + static_cast<double>(volume.size.z - 1) * volume.spacing_mm.z;
  map.row_spacing_mm = volume.spacing_mm.z;
  return map;
}

/// The longest step of at most `most_mm` that divides the outermost radius.
double step_within(const std::vector<double>& radii_mm, double most_mm) {
  return radii_mm.empty() ? most_mm : radii_mm.back() / std::max(1.0, std::ceil(radii_mm.back() / most_mm));
}

void validate_outline(const MapGeometry& geometry, const std::string& name) {
  const std::size_t width = static_cast<std::size_t>(geometry.width), size = geometry.outline_mm.size();
  if (geometry.ray_layout == RayLayout::rectangle)
    throw InputError("{}: a rectangle map has no outline", name);
  if (size != width && size != width * static_cast<std::size_t>(geometry.height))
    throw InputError("{}: an outline of {} radii for {} x {} texels", name, size, geometry.width,
                     geometry.height);
  float largest_mm = 0;
  for (const float radius_mm : geometry.outline_mm) {
    if (!(radius_mm > 0 && radius_mm <= kMaxRadius_mm))
      throw InputError("{}: its outline has a radius of {} mm, outside 0 to {}", name, radius_mm,
                       kMaxRadius_mm);
    largest_mm = std::max(largest_mm, radius_mm);
  }
  // Less where these are the narrower rows of a map.
  if (largest_mm > (1 + 1e-6) * geometry.radius_mm())
    throw InputError("{}: its outline reaches {:g} mm, but its shells {:g} mm", name, largest_mm,
                     geometry.radius_mm());
}

}  // namespace

FieldOfView field_of(const VolumeGeometry& volume) { return {volume.lower_mm(), volume.upper_mm()}; }

std::string to_string(RayLayout ray_layout) {
  switch (ray_layout) {
    case RayLayout::cylinder:
      return "cylinder";
    case RayLayout::sphere:
      return "sphere";
    case RayLayout::rectangle:
      return "rectangle";
  }
  return {};
}

RayLayout parse_ray_layout(const std::string& name) {
  for (const RayLayout ray_layout : {RayLayout::cylinder, RayLayout::sphere, RayLayout::rectangle})
    if (to_string(ray_layout) == name) return ray_layout;
  throw InputError("unknown projection '{}'; choose cylinder, sphere or rectangle", excerpt(name));
}

std::vector<double> shell_radii_mm(RadiiRule rule, int layers, double radius_mm) {
  if (layers < 1 || layers > kMaxLayers)
    throw InputError("layers is {}, but must be 1 to {}", layers, kMaxLayers);
  if (!std::isfinite(radius_mm) || radius_mm <= 0)
    throw InputError("radius is {} mm, but must be above 0", radius_mm);
  std::vector<double> radii;
  for (int k = 0; k <= layers; ++k) {
    const double share = static_cast<double>(k) / layers;
    radii.push_back(radius_mm * (rule == RadiiRule::equal_area        ? std::sqrt(share)
                                 : rule == RadiiRule::equal_thickness ? share
                                                                      : std::pow(share, 0.43)));
  }
  return radii;
}

double MapGeometry::phi_rad(double column) const { return (column + 0.5) * 2 * std::numbers::pi / width; }

double MapGeometry::theta_rad(double row) const { return (row + 0.5) * std::numbers::pi / height; }

FieldOfView::Corners FieldOfView::corners_mm() const {
  return {{{lower_mm.x, lower_mm.y, lower_mm.z}, {upper_mm.x, upper_mm.y, upper_mm.z}}};
}

FieldOfView FieldOfView::between(const Corners& corners_mm) {
  const auto& [lower, upper] = corners_mm;
  return {{lower[0], lower[1], lower[2]}, {upper[0], upper[1], upper[2]}};
}

double MapGeometry::view_rad(double layer) const { return layer * std::numbers::pi / views; }

double MapGeometry::scale(int column, int row) const {
  if (!has_outline()) return 1;
  const std::size_t first = has_plane_outline() ? 0 : static_cast<std::size_t>(row) * width;
  return outline_mm[first + static_cast<std::size_t>(column)] / radius_mm();
}

double MapGeometry::shell_radius_mm(double radius_mm, double column, double row) const {
  if (!has_outline()) return radius_mm;
  const double left = std::floor(column), held = std::clamp(row, 0.0, height - 1.0), upper = std::floor(held);
  const int i = static_cast<int>(left), j = static_cast<int>(upper);
  const auto at = [&](int dx, int dy) {
    return scale(((i + dx) % width + width) % width, std::min(j + dy, height - 1));
  };
  const double across = column - left, down = held - upper;
  return radius_mm /
         std::lerp(std::lerp(at(0, 0), at(1, 0), across), std::lerp(at(0, 1), at(1, 1), across), down);
}

double MapGeometry::reach_mm(int column, int row) const {
  if (!field) return radius_mm();
  const double phi = phi_rad(column), theta = theta_rad(row);
  glm::dvec3 from(centre_of_row_mm(row), centre_z_mm), along(std::sin(phi), -std::cos(phi), 0);
  if (ray_layout == RayLayout::sphere)
    along = {std::sin(theta) * along.x, std::sin(theta) * along.y, std::cos(theta)};
  along *= scale(column, row);
  double samples = radius_mm() / step_mm;
  for (int axis = 0; axis < 3; ++axis) {
    const double room_mm =
        along[axis] > 0 ? field->upper_mm[axis] - from[axis] : from[axis] - field->lower_mm[axis];
    if (along[axis] != 0)
      samples = std::min(samples, std::floor(room_mm / std::abs(along[axis]) / step_mm + 0.5));
  }
  return std::clamp(samples * step_mm, 0.0, radius_mm());
}

MapGeometry cylinder_map(const VolumeGeometry& volume, int angles, std::vector<double> radii_mm,
                         glm::dvec2 centre_mm) {
  return cylinder_map(volume, angles, std::move(radii_mm), std::vector{centre_mm});
}

MapGeometry cylinder_map(const VolumeGeometry& volume, int angles, std::vector<double> radii_mm,
                         std::vector<glm::dvec2> centre_of_row_mm) {
  for (const glm::dvec2& centre : centre_of_row_mm) check_within(volume, {centre, volume.origin_mm.z});
  MapGeometry map = map_of_slices(volume);
  map.width = angles;
  map.radii_mm = std::move(radii_mm);
  map.centre_mm = std::move(centre_of_row_mm);
  map.step_mm = step_within(map.radii_mm, std::min(volume.spacing_mm.x, volume.spacing_mm.y));
  map.field = field_of(volume);
  validate(map, "map");
  return map;
}

MapGeometry sphere_map(const VolumeGeometry& volume, int angles, std::vector<double> radii_mm,
                       const glm::dvec3& centre_mm) {
  check_within(volume, centre_mm);
  MapGeometry map;
  map.ray_layout = RayLayout::sphere;
  map.width = angles;
  map.height = std::max(1, angles / 2);
  map.radii_mm = std::move(radii_mm);
  map.centre_mm = {glm::dvec2(centre_mm)};
  map.centre_z_mm = centre_mm.z;
  map.step_mm =
      step_within(map.radii_mm, std::min({volume.spacing_mm.x, volume.spacing_mm.y, volume.spacing_mm.z}));
  map.field = field_of(volume);
  validate(map, "map");
  return map;
}

MapGeometry rectangle_map(const VolumeGeometry& volume, int views, double radius_mm, glm::dvec2 centre_mm) {
  check_within(volume, {centre_mm, volume.origin_mm.z});
  const double pixel_mm = std::min(volume.spacing_mm.x, volume.spacing_mm.y);
  const auto pixels = [&](double length_mm) {
    const double count = std::ceil(length_mm / pixel_mm - 1e-6);  // but for rounding
    if (!(count >= 1 && count <= kMaxAngles))
      throw InputError("rectangle: {:g} mm at {:g} mm per pixel does not give a picture 1 to {} pixels wide",
                       length_mm, pixel_mm, kMaxAngles);
    return static_cast<int>(count);
  };
  MapGeometry map;
  map.ray_layout = RayLayout::rectangle;
  map.views = views;
  map.width = pixels(2 * radius_mm);
  map.height = pixels(static_cast<double>(volume.size.z) * volume.spacing_mm.z);
  map.radii_mm = {0, radius_mm};
  map.centre_mm = {centre_mm};
  map.top_mm = volume.upper_mm().z - 0.5 * pixel_mm;
  map.row_spacing_mm = pixel_mm;
  map.step_mm = pixel_mm;
  validate(map, "map");
  return map;
}

MapGeometry with_outline(MapGeometry circles, std::vector<float> outline_mm) {
  const double largest_mm = outline_mm.empty() ? 0 : std::ranges::max(outline_mm);
  if (largest_mm > 0) {
    const double shrinks = largest_mm / circles.radius_mm();
    for (double& radius_mm : circles.radii_mm) radius_mm *= shrinks;
    circles.radii_mm.back() = largest_mm;
    circles.step_mm = step_within(circles.radii_mm, circles.step_mm);
  }
  circles.outline_mm = std::move(outline_mm);
  validate(circles, "map");
  return circles;
}

void validate(const MapGeometry& geometry, const std::string& name) {
  if (geometry.width < 1 || geometry.width > kMaxAngles)
    throw InputError("{}: {} angles, but there must be 1 to {}", name, geometry.width, kMaxAngles);
  if (geometry.height < 1 || geometry.height > 65536)
    throw InputError("{}: height is {}", name, geometry.height);
  if (geometry.ray_layout == RayLayout::rectangle && (geometry.views < 1 || geometry.views > kMaxViews))
    throw InputError("{}: {} views, but there must be 1 to {}", name, geometry.views, kMaxViews);
  if (geometry.radii_mm.size() < 2 || geometry.radii_mm.size() > kMaxLayers + 1)
    throw InputError("{}: {} radii, but there must be 2 to {}", name, geometry.radii_mm.size(),
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
  if (!std::isfinite(geometry.centre_z_mm)) throw InputError("{}: the centre is not finite", name);
  if (!std::isfinite(geometry.top_mm) || !std::isfinite(geometry.row_spacing_mm) ||
      geometry.row_spacing_mm <= 0)
    throw InputError("{}: top or row spacing is invalid", name);
  for (int axis = 0; geometry.field && axis < 3; ++axis) {
    const double lower = geometry.field->lower_mm[axis], upper = geometry.field->upper_mm[axis];
    if (!std::isfinite(lower) || !std::isfinite(upper) || lower > upper)
      throw InputError("{}: its field from {:g} to {:g} mm is invalid", name, lower, upper);
  }
  if (geometry.has_outline()) validate_outline(geometry, name);
  if (!(geometry.step_mm > 0) || !(geometry.radius_mm() / geometry.step_mm < 1e6))
    throw InputError("{}: step of {} mm is invalid", name, geometry.step_mm);
}

}  // namespace xraycast
