#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

namespace xraycast {

/// How a found tree differs from the true one.
struct TreeDifference {
  /// Each true end has one of its own within half its radius and half a millimetre, there are no others, and
  /// the same ends lie beyond the branches of both.
  bool is_whole = false;
  double off_95_mm = 0;  ///< of 95 % of true points from the found lines, outside of their parents' lumen
  double radius_95 = 0;  ///< relative, of 95 % of these points
};

TreeDifference tree_difference(const VesselTree& truth, const VesselTree& found);

}  // namespace xraycast
