#include "xraycast/given_vessels/place_in_scan.hpp"

#include "xraycast/base/error.hpp"

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <utility>

namespace xraycast {
namespace {

/// The share of points, scaled and turned by a diagonal matrix, that lie within a scan.
double share_inside(std::span<const glm::vec3> points_mm, const VolumeGeometry& scan,
                    const glm::dvec3& factors) {
  const glm::dvec3 lower = scan.lower_mm(), upper = scan.upper_mm();
  const auto inside = std::ranges::count_if(points_mm, [&](const glm::vec3& p) {
    const glm::dvec3 mm = factors * glm::dvec3(p);
    return glm::all(glm::greaterThanEqual(mm, lower)) && glm::all(glm::lessThanEqual(mm, upper));
  });
  return static_cast<double>(inside) / static_cast<double>(std::max<std::size_t>(points_mm.size(), 1));
}

/// What would put the points within the scan, in words; empty where nothing does.
std::string remedy(std::span<const glm::vec3> points_mm, const VolumeGeometry& scan) {
  constexpr double kFits = 0.95;
  for (const double turned : {1.0, -1.0})
    for (const double factor : {1.0, 10.0, 100.0, 1000.0, 0.1, 0.01, 0.001}) {
      if (share_inside(points_mm, scan, {factor * turned, factor * turned, factor}) < kFits) continue;
      const std::string frame = turned < 0 ? " in the other `frame`" : "",
                        unit = factor != 1 ? fmt::format(" with a `unit` {:g} times as long", factor) : "";
      return fmt::format("; it would fit{}{}", frame, unit);
    }
  return "; check that it is of this patient";
}

/// The CT numbers at points, each of which is turned by 180 degrees about the head's axis by `turned` -1; air
/// beyond the scan.
std::vector<double> hu_at(std::span<const glm::vec3> points_mm, const Volume& scan, double turned) {
  constexpr std::size_t kMost = 20'000;
  const std::size_t step = std::max<std::size_t>(1, points_mm.size() / kMost);
  const VolumeGeometry& grid = scan.geometry();
  std::vector<double> hu;
  for (std::size_t i = 0; i < points_mm.size(); i += step) {
    const glm::dvec3 p(turned * points_mm[i].x, turned * points_mm[i].y, points_mm[i].z);
    const Index3 voxel(glm::round(grid.to_index(p)));
    const bool is_in =
        glm::all(glm::greaterThanEqual(voxel, Index3(0))) && glm::all(glm::lessThan(voxel, grid.size));
    hu.push_back(is_in ? scan.at(voxel.x, voxel.y, voxel.z) : -1000);
  }
  return hu;
}

/// Whether points fit a scan much better in the other frame: far fewer lie in air, or they are brighter than
/// blood differs from soft tissue.
bool fits_turned(std::span<const glm::vec3> points_mm, const Volume& scan) {
  constexpr double kAir_hu = -300, kFewer = 0.2, kBrighter_hu = 60;
  const auto look = [&](double turned) {
    std::vector<double> hu = hu_at(points_mm, scan, turned);
    const auto in_air = std::ranges::count_if(hu, [](double h) { return h < kAir_hu; });
    const auto middle = hu.begin() + static_cast<std::ptrdiff_t>(hu.size() / 2);
    std::ranges::nth_element(hu, middle);
    return std::pair(static_cast<double>(in_air) / static_cast<double>(hu.size()), *middle);
  };
  const auto [air, hu] = look(1);
  const auto [turned_air, turned_hu] = look(-1);
  return turned_air < air - kFewer || (turned_air <= air && turned_hu > hu + kBrighter_hu);
}

/// The share of a scan's length from foot to head that points extend over.
double share_of_length(std::span<const glm::vec3> points_mm, const VolumeGeometry& scan) {
  const auto [lowest, highest] = std::ranges::minmax(points_mm, {}, &glm::vec3::z);
  return (highest.z - lowest.z) / (scan.upper_mm().z - scan.lower_mm().z);
}

}  // namespace

std::vector<std::string> check_place(std::span<const glm::vec3> points_mm, const Volume& scan,
                                     const std::string& name) {
  if (points_mm.empty()) return {};
  constexpr double kMost = 0.5, kAll = 0.99, kShort = 0.15;
  const VolumeGeometry& grid = scan.geometry();
  const double inside = share_inside(points_mm, grid, glm::dvec3(1));
  if (inside < kMost)
    throw InputError("{}: {:.0f} % of it lies outside the scan{}", name, 100 * (1 - inside),
                     remedy(points_mm, grid));
  std::vector<std::string> notes;
  if (inside < kAll)
    notes.push_back(fmt::format("{}: {:.0f} % of it lies outside the scan", name, 100 * (1 - inside)));
  if (fits_turned(points_mm, scan))
    notes.push_back(
        fmt::format("{}: would fit the scan better in the other `frame`; look at the report", name));
  if (share_of_length(points_mm, grid) < kShort && share_inside(points_mm, grid, glm::dvec3(10)) > kAll)
    notes.push_back(
        fmt::format("{}: fills {:.0f} % of the scan's length; if its lengths are in cm, say so by `unit`",
                    name, 100 * share_of_length(points_mm, grid)));
  return notes;
}

}  // namespace xraycast
