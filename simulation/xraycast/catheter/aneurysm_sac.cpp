#include "xraycast/catheter/aneurysm_sac.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {

double AneurysmSac::volume_mm3() const {
  const double ball_mm3 = 4 * std::numbers::pi / 3 * radius_mm * radius_mm * radius_mm;
  const double cap_mm = std::max(0.0, radius_mm - neck_mm);
  return ball_mm3 - std::numbers::pi * cap_mm * cap_mm * (3 * radius_mm - cap_mm) / 3;
}

double AneurysmSac::depth_mm(const glm::dvec3& place_mm) const {
  const glm::dvec3 from_centre_mm = place_mm - centre_mm;
  return std::min(radius_mm - glm::length(from_centre_mm), glm::dot(from_centre_mm, outwards) + neck_mm);
}

std::optional<AneurysmSac> sac_of(const VesselTree& tree, int branch) {
  const VesselBranch& of = tree.branches()[static_cast<std::size_t>(branch)];
  if (of.parent < 0 || !of.children.empty() || of.name.find("aneurysm") == std::string::npos) return {};
  const auto is_narrower = [](const VesselPoint& a, const VesselPoint& b) {
    return a.radius_mm < b.radius_mm;
  };
  const VesselPoint& widest = *std::max_element(of.points.begin() + 1, of.points.end(), is_narrower);
  const VesselPoint& root = tree.branches()[static_cast<std::size_t>(of.parent)].points.back();
  const double from_axis_mm = glm::distance(widest.position_mm, root.position_mm);
  AneurysmSac sac{.branch = branch,
                  .centre_mm = widest.position_mm,
                  .radius_mm = widest.radius_mm,
                  .outwards = (widest.position_mm - root.position_mm) / from_axis_mm,
                  .neck_mm = std::clamp(from_axis_mm - root.radius_mm, 0.0, widest.radius_mm),
                  .neck_radius_mm = 0,
                  .vessel_radius_mm = root.radius_mm};
  double narrowest_mm = sac.radius_mm;
  for (const VesselPoint& point : of.points) narrowest_mm = std::min(narrowest_mm, point.radius_mm);
  const double chord2 = sac.radius_mm * sac.radius_mm - sac.neck_mm * sac.neck_mm;
  sac.neck_radius_mm = std::max(narrowest_mm, std::sqrt(std::max(0.0, chord2)));
  return sac;
}

std::vector<AneurysmSac> sacs_of(const VesselTree& tree) {
  std::vector<AneurysmSac> sacs;
  for (std::size_t b = 0; b < tree.branches().size(); ++b)
    if (const std::optional<AneurysmSac> sac = sac_of(tree, static_cast<int>(b))) sacs.push_back(*sac);
  return sacs;
}

}  // namespace xraycast
