#include "xraycast/scene/catheter_surface.hpp"

#include "xraycast/scene/vessels.hpp"

namespace xraycast {

Surface catheter_surface(const std::vector<glm::dvec3>& nodes_mm, double radius_mm) {
  constexpr std::size_t kFewest = 4;  // of a cubic
  if (nodes_mm.size() < kFewest) return {};
  // No smoother than is seen at a catheter's width: the mesh is rebuilt for every frame.
  constexpr int kRingsPerNode = 3, kSides = 8;
  return {tube_mesh(curve_through(nodes_mm), radius_mm, kRingsPerNode, kSides), catheter_per_mm(),
          kCatheterColour};
}

VesselTree::Location place_of(const CatheterTip& tip) {
  VesselTree::Location place;
  place.branch = tip.branch;
  place.arc_length_mm = tip.arc_length_mm;
  return place;
}

}  // namespace xraycast
