#pragma once

#include "xraycast/geometry/tube.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/scene/fluoroscopy_beam.hpp"
#include "xraycast/scene/scene.hpp"

#include <vector>

namespace xraycast {

/// Vessels filled unevenly with contrast agent, as a surface to draw in the fluoro look: of every branch a
/// row of drums, each closed and with its own absorption. Where branches meet their drums overlap, and what
/// absorbs most counts.
class ContrastSurface {
 public:
  /// Takes drums of about two millimetres, made of whole stretches of the tree; `mu_per_mm` is what one mg/ml
  /// of iodine absorbs.
  explicit ContrastSurface(const VesselTree& tree, double mu_per_mm = fluoroscopy_per_mm("I", 1));

  /// The surface for concentrations of iodine in every branch's stretches, one fewer than its points, in
  /// mg/ml. Drums without iodine are left out.
  Surface filled(const std::vector<std::vector<double>>& iodine_mg_ml) const;

 private:
  struct Drum {
    int branch;
    std::size_t first, last;  ///< stretches [first, last)
    Ring from, to;
  };
  double mu_per_mm_;
  std::vector<Drum> drums_;
};

}  // namespace xraycast
