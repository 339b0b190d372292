#pragma once

#include "xraycast/geometry/segment_index.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <vector>

namespace xraycast {

/// A place on a tree's centrelines.
struct TubePlace {
  int branch = -1, point = 0;  ///< its piece begins at this point
  double fraction = 0;         ///< of the way along the piece
  glm::dvec3 centre_mm{0, 0, 0};
  double radius_mm = 0;
  double out_mm = 0;  ///< how far the asked point is out of the lumen there; negative within

  double arc_length_mm(const VesselTree& tree) const;
};

/// To whose lumen points belong: that of the place in whose sphere they lie deepest. Where a thin vessel
/// leaves a wide one, the nearest centreline would not tell.
class TubePlaces {
 public:
  /// Of the branches that count, of which there must be one; all without a list.
  explicit TubePlaces(const VesselTree& tree, const std::vector<bool>& counts = {});

  TubePlace deepest(const glm::dvec3& point_mm) const;

 private:
  SegmentIndex pieces_;
};

}  // namespace xraycast
