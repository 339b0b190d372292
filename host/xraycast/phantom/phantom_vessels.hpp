#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <initializer_list>
#include <span>
#include <vector>

namespace xraycast {

/// A smooth curve through control points (centripetal Catmull-Rom, radii too), sampled every `step_mm` or
/// closer; the control points themselves are kept. Two or more controls.
std::vector<VesselPoint> smooth_curve(std::span<const VesselPoint> controls, double step_mm);

/// Grows a vessel tree from smooth curves: every branch begins exactly where its parent ends.
class VesselGrower {
 public:
  static constexpr int kRoot = -1;

  /// A vessel through `controls`, cut into branches at the control points whose indices are `forks`
  /// (ascending), so that other vessels can leave there. It begins at the end of branch `parent`, which is
  /// not among the controls; with kRoot, at the first control. `first_radius_mm` is its own radius at its
  /// beginning, inside the parent. Returns its branches, from its beginning onwards: one more than forks.
  std::vector<int> grow(int parent, double first_radius_mm, std::vector<VesselPoint> controls,
                        std::initializer_list<std::size_t> forks = {});

  const std::vector<VesselBranch>& branches() const { return branches_; }

 private:
  std::vector<VesselBranch> branches_;
};

}  // namespace xraycast
