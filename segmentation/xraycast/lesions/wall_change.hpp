#pragma once

#include "xraycast/geometry/segment_index.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/lesions/edited_lumen.hpp"
#include "xraycast/lesions/placed_edits.hpp"
#include "xraycast/lesions/tube_places.hpp"

#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace xraycast {

/// How walls move where vessels become narrower or wider: two trees with the same branches and points. A
/// point beside a centreline stays at the same share of the radius from it, so the lumen keeps its own
/// outline, and what is nearer to other centrelines stays where it is.
class WallChange {
 public:
  /// Both have the same numbers of points in each branch.
  WallChange(VesselTree before, VesselTree after);

  const VesselTree& before() const { return before_; }
  const VesselTree& after() const { return after_; }
  bool is_empty() const { return !changed_; }

  /// Where a point of the wall goes; bit for bit the same where nothing changes.
  glm::dvec3 moved(const glm::dvec3& point_mm) const;

  /// What fills a point afterwards. A vessel's lumen is looked for within half a radius and a millimetre
  /// beyond its wall, before and after.
  LumenSource source(const glm::dvec3& point_mm) const;

  /// How long edges of a surface may be at a point, so that they follow the change; infinite where it is
  /// even.
  double edge_mm(const glm::dvec3& point_mm) const;

  /// Points of the centrelines, as they were, where something changes.
  std::vector<glm::dvec3> middles_mm() const;

  /// The box of what changes, with the lumen around.
  std::pair<glm::dvec3, glm::dvec3> box_mm() const;

 private:
  /// The place in both states.
  struct Both {
    VesselPoint before, after;
  };
  std::optional<Both> both_at(const TubePlace& place) const;
  /// How far a point is from all that changes; not above zero within.
  double beyond_mm(const glm::dvec3& point_mm) const;
  bool changes(int branch, int point) const;

  VesselTree before_, after_;
  TubePlaces lumens_before_, lumens_after_;
  std::vector<std::vector<char>> changes_, uneven_;  ///< one for each piece of each branch
  std::unique_ptr<SegmentIndex> changed_;            ///< how far those that do reach, before and after
};

/// The change by stenoses and scaled radii. Points are added where a stenosis needs them; elsewhere all stay
/// as they are, bit for bit.
WallChange wall_change(const VesselTree& tree, const PlacedEdits& edits);

}  // namespace xraycast
