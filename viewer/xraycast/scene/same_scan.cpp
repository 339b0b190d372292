#include "xraycast/scene/same_scan.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/casting/key_maps.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>
#include <string_view>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

bool is_same(const FieldOfView& a, const FieldOfView& b) {
  constexpr double kSame_mm = 0.01;  // files of scans round coordinates to 32-bit floats or a few digits
  return glm::all(glm::lessThan(glm::abs(a.lower_mm - b.lower_mm), glm::dvec3(kSame_mm))) &&
         glm::all(glm::lessThan(glm::abs(a.upper_mm - b.upper_mm), glm::dvec3(kSame_mm)));
}

/// Whether the rows of a cylinder map are slices of this distance, of which the uppermost lies at `top_mm`.
/// Scans of one extent may differ in slices.
bool has_rows(const MapGeometry& map, double top_mm, double slice_mm) {
  constexpr double kSame = 0.01;  // of a slice
  return std::abs(map.row_spacing_mm - slice_mm) * map.height <= kSame * slice_mm &&
         std::abs(map.top_mm - top_mm) <= kSame * slice_mm;
}

bool has_same_rows(const MapGeometry& a, const MapGeometry& b) {
  return a.height == b.height && has_rows(a, b.top_mm, b.row_spacing_mm);
}

MapGeometry without_field(MapGeometry geometry) {
  geometry.field.reset();
  return geometry;
}

/// Why a map cannot be of a scan, or nothing. A cylinder's rows are the scan's slices; of a sphere only the
/// centre is compared.
std::string difference(const MapGeometry& map, const VolumeGeometry& volume) {
  const glm::dvec3 centre_mm = bounds_of(map).centre_mm, lower = volume.lower_mm(), upper = volume.upper_mm();
  if (glm::any(glm::lessThan(centre_mm, lower)) || glm::any(glm::greaterThan(centre_mm, upper)))
    return "it lies outside the scan";
  if (map.ray_layout == RayLayout::rectangle)  // of rows of its own, over the scan's whole height
    return std::abs(map.row_spacing_mm * map.height - (upper.z - lower.z)) > 2 * map.row_spacing_mm
               ? "its height differs"
               : "";
  if (map.ray_layout == RayLayout::cylinder) {
    if (map.height != volume.size.z)
      return fmt::format("it has {} rows, but the scan has {} slices", map.height, volume.size.z);
    const double slice_mm = volume.spacing_mm.z, top_mm = upper.z - 0.5 * slice_mm;
    if (!has_rows(map, top_mm, slice_mm))
      return fmt::format(
          "its rows are {:.4g} mm apart from {:.4g} mm downwards, the scan's slices {:.4g} mm from {:.4g} mm",
          map.row_spacing_mm, map.top_mm, slice_mm, top_mm);
  }
  if (map.field && !is_same(*map.field, field_of(volume))) return "its field of view differs";
  return "";
}

}  // namespace

void check_same_scan(const MapGeometry& map, const std::string& name, const VolumeGeometry& volume,
                     const std::string& scan) {
  if (const std::string why = difference(map, volume); !why.empty())
    throw InputError("{} was not cast from {}: {}; give its own scan", name, scan, why);
}

void check_same_scan(const MapGeometry& map, const std::string& name, const MapGeometry& basis,
                     const std::string& basis_name) {
  const bool is_cylinder = map.ray_layout == RayLayout::cylinder;
  const bool same = map.field && basis.field
                        ? is_same(*map.field, *basis.field) && (!is_cylinder || has_same_rows(map, basis))
                        : without_field(map) == without_field(basis);
  if (!same)
    throw InputError("{} was not cast from the scan of {}: their geometries differ; give its own basis", name,
                     basis_name);
}

bool may_be_source(const std::string& source, const fs::path& scan, const std::string& format) {
  fs::path path = fs::absolute(scan).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();
  const std::string place = source.starts_with(format + " ") ? source.substr(format.size() + 1) : source;
  const std::string name = path.filename().string();
  const auto at = place.rfind(name);
  if (at == std::string::npos) return false;
  std::string_view behind = std::string_view(place).substr(at + name.size());
  if (behind.starts_with("/")) behind.remove_prefix(1);
  if (!behind.empty() && !behind.starts_with(", ")) return false;
  const fs::path told = fs::path(place.substr(0, at) + name).lexically_normal();
  std::error_code error;
  if (fs::exists(told, error) && fs::exists(path, error)) return fs::equivalent(told, path, error);
  if (told.is_absolute()) return told == path;
  const std::vector<fs::path> parts(told.begin(), told.end()), all(path.begin(), path.end());
  const auto [end, other] = std::mismatch(parts.rbegin(), parts.rend(), all.rbegin(), all.rend());
  return end == parts.rend() || *end == "..";
}

std::map<std::string, double> instant_of(const std::string& source) {
  std::map<std::string, double> phases;
  std::string_view left = source;
  for (auto comma = left.rfind(", "); comma != std::string_view::npos; comma = left.rfind(", ")) {
    const std::string_view words = left.substr(comma + 2);
    const auto space = words.find(' ');
    double phase = 0;
    if (space == 0 || space == std::string_view::npos || !parse_whole(words.substr(space + 1), phase) ||
        !(phase >= 0 && phase <= 1))
      break;
    if (phase > 0) phases[std::string(words.substr(0, space))] = phase;
    left = left.substr(0, comma);
  }
  return phases;
}

void check_same_instant(const BodyMap& map, const std::string& name, const std::string& other) {
  if (map.keys) return;
  const auto words = [](const std::map<std::string, double>& phases) {
    std::string all;
    for (const auto& [mode, phase] : phases)
      all += fmt::format("{}{} {:.3g}", all.empty() ? "" : ", ", mode, phase);
    return all.empty() ? std::string("at rest") : "at " + all;
  };
  const std::string of_map = words(instant_of(map.source)), of_other = words(instant_of(other));
  if (of_map != of_other)
    throw InputError(
        "{} shows the body {}, but {} is {}; give both of one instant, or a map that moves (`xraycast cast "
        "--motion` without --phase and --time)",
        name, of_map, other, of_other);
}

void check_same_modes(const BodyMap& map, const Motion& motion) {
  if (!map.keys) return;
  const auto has_name = [](const MotionMode& a, const MotionMode& b) { return a.name == b.name; };
  if (!std::ranges::equal(map.keys->phases().rhythm().modes(), motion.modes(), has_name))
    throw InputError("{}: has other modes than the map; give the motion by which the map was cast",
                     motion.name());
}

}  // namespace xraycast
