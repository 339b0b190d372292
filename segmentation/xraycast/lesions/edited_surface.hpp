#pragma once

#include "xraycast/geometry/mesh.hpp"
#include "xraycast/lesions/wall_change.hpp"

#include <optional>
#include <vector>

namespace xraycast {

/// An aneurysm's ball: it meets the wall in an opening around `wall_mm`.
struct SacBall {
  glm::dvec3 wall_mm, outwards;  ///< the neck's middle on the wall; unit vector away from the vessel
  double height_mm, radius_mm;   ///< of its centre above that
  glm::dvec3 centre_mm() const { return wall_mm + height_mm * outwards; }
};

/// The surface where its wall has moved, with smaller triangles where it bends. Points and triangles
/// elsewhere stay as they are.
Mesh moved_surface(const Mesh& surface, const WallChange& change);

/// How far a surface lies from a point in a direction: of the places where a ray leaves it, the nearest to
/// `about_mm`; nothing within a factor of two.
std::optional<double> wall_in_direction_mm(const Mesh& surface, const glm::dvec3& from_mm,
                                           const glm::dvec3& direction, double about_mm);

/// The surface joined with a ball: the wall within it is cut out, and the ball outside of the wall closes the
/// cut. Nothing where the ball and the wall do not meet in one loop.
std::optional<Mesh> with_sac(const Mesh& surface, const SacBall& ball);

/// The surface without the walls of branches: cut where the lumen of others is as near, and closed there
/// along the others' wall.
Mesh without_branches(const Mesh& surface, const VesselTree& tree, const std::vector<bool>& is_removed);

}  // namespace xraycast
