#include "xraycast/viewer/catheter_surface.hpp"

#include "xraycast/viewer/vessels.hpp"

namespace xraycast {

Surface catheter_surface(const std::vector<glm::dvec3>& nodes_mm, double radius_mm) {
  constexpr double kCatheter_per_mm = 0.3;
  constexpr std::size_t kFewest = 4;  // of a cubic
  if (nodes_mm.size() < kFewest) return {};
  return {tube_mesh(curve_through(nodes_mm), radius_mm), kCatheter_per_mm, {0.25, 0.55, 0.95}};
}

VesselTree::Location place_of(const CatheterTip& tip) {
  VesselTree::Location place;
  place.branch = tip.branch;
  place.arc_length_mm = tip.arc_length_mm;
  return place;
}

}  // namespace xraycast
