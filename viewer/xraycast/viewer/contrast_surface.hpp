#pragma once

#include "xraycast/tube.hpp"
#include "xraycast/vessel_tree.hpp"
#include "xraycast/viewer/scene.hpp"

#include <vector>

namespace xraycast {

/// Vessels filled unevenly with contrast agent, as a surface to draw in the fluoro look: of every branch a
/// row of drums, each closed and with its own absorption. Where branches meet their drums overlap, and what
/// absorbs most counts.
class ContrastSurface {
 public:
  /// Takes drums of about `drum_mm`, made of whole stretches of the tree.
  explicit ContrastSurface(const VesselTree& tree, double drum_mm = 2);

  /// The surface for concentrations of iodine in every branch's stretches, one fewer than its points, in
  /// mg/ml; `mu_per_mm` is what one mg/ml absorbs. Drums without iodine are left out.
  Surface filled(const std::vector<std::vector<double>>& iodine_mg_ml, double mu_per_mm) const;

 private:
  struct Drum {
    int branch;
    std::size_t first, last;  ///< stretches [first, last)
    Ring from, to;
  };
  std::vector<Drum> drums_;
};

}  // namespace xraycast
