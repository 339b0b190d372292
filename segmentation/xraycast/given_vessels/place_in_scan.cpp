#include "xraycast/given_vessels/place_in_scan.hpp"

#include "xraycast/base/error.hpp"

#include <fmt/format.h>
#include <glm/vector_relational.hpp>

#include <algorithm>

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
      return "; it would fit" + frame + unit;
    }
  return "; check that it is of this patient";
}

}  // namespace

std::vector<std::string> check_place(std::span<const glm::vec3> points_mm, const VolumeGeometry& scan,
                                     const std::string& name) {
  constexpr double kMost = 0.5, kAll = 0.99;
  const double inside = share_inside(points_mm, scan, glm::dvec3(1));
  if (inside < kMost)
    throw InputError("{}: {:.0f} % of it lies outside the scan{}", name, 100 * (1 - inside),
                     remedy(points_mm, scan));
  if (inside >= kAll) return {};
  return {fmt::format("{}: {:.0f} % of it lies outside the scan", name, 100 * (1 - inside))};
}

}  // namespace xraycast
