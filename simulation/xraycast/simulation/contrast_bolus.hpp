#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/simulation/cardiac_waveform.hpp"
#include "xraycast/simulation/laminar_vessel.hpp"

#include <vector>

namespace xraycast {

/// The blood's flow through a vessel tree.
struct Blood {
  /// Mean over a heartbeat. 5 l/min through an aorta of 25 mm are 170 mm/s, and the mean velocities in the
  /// arteries that leave it are similar (Caro et al., The Mechanics of the Circulation, 2012).
  double root_velocity_mm_s = 170;
  double heart_rate_bpm = 70;  ///< 0: steady flow
  /// A bifurcation divides the flow by this power of its branches' radii. 2 keeps the velocity, as in large
  /// arteries; arterioles follow Murray's cube (Zamir, The Physics of Pulsatile Flow, 2000).
  double split_exponent = 2;
  double profile_exponent = 0;  ///< of every LaminarVessel; 0: by its Womersley number
  /// Of a molecule of 800 g/mol in plasma, by Stokes and Einstein.
  double diffusivity_mm2_s = 3e-4;
};

/// Transport of iodine by the blood through a vessel tree, from where contrast agent is injected until it
/// washes out.
///
/// Flow: pulsatile by CardiacWaveform in rigid vessels, from the root to the leaves. The resistance of the
/// periphery is far above that of the tree, so that an injection does not change what flows out of the
/// leaves: it takes the place of blood that would come from the root. Where it exceeds the flow, the rest
/// refluxes towards the root, and from there into other branches (as seen by Kovarovic et al., Cardiovasc Eng
/// Technol 9:226, 2018).
///
/// Transport: a LaminarVessel for every branch. Its profile's exponent is the Womersley number, the ratio of
/// the radius to the thickness of the oscillating boundary layer, between 2, a parabola, and 9, as measured
/// in arteries (Smith et al., SIAM J Appl Math 62:990, 2002). At bifurcations the laminae mix. In arteries
/// the time of Taylor's dispersion is minutes, so that a bolus spreads by the profile's shear.
class ContrastBolus {
 public:
  ContrastBolus(const VesselTree& tree, const Blood& blood);
  explicit ContrastBolus(const VesselTree& tree) : ContrastBolus(tree, Blood{}) {}

  /// Advances by `time_s` (0 or more), while `injection_ml_s` (0 for none) of an agent of `agent_mg_ml`
  /// iodine is injected at a location of the tree.
  void step(double time_s, const VesselTree::Location& tip, double injection_ml_s, double agent_mg_ml = 350);

  /// Iodine concentration in every branch's segments, one fewer than its points.
  const std::vector<std::vector<double>>& iodine_mg_ml() const { return iodine_mg_ml_; }

  double in_tree_mg() const;

  /// Iodine that has left the tree: through its leaves, and where it refluxes through its root.
  double washed_out_mg() const { return washed_out_mg_; }

  /// The blood's mean flow through a branch, without an injection.
  double mean_flow_ml_s(int branch) const { return blood_ml_s_[static_cast<std::size_t>(branch)]; }

 private:
  /// A branch's end, or the root's start.
  struct Junction {
    double entering_mg = 0, leaving_ml = 0;  ///< in a step
    double mg_ml() const { return leaving_ml > 0 ? entering_mg / leaving_ml : 0; }
  };

  void divide_flow();
  void place_source(const VesselTree::Location& tip, double ml_s, double mg_ml);
  double longest_step_s() const;
  void set_flow(double relative_flow);
  void advect(double time_s);

  const VesselTree& tree_;
  Blood blood_;
  CardiacWaveform waveform_;
  std::vector<int> order_;          ///< branches, parents first
  std::vector<double> blood_ml_s_;  ///< of every branch, the mean
  std::vector<LaminarVessel> vessels_;
  std::vector<Junction> junctions_;  ///< the branches' ends, then the root's start
  std::vector<std::vector<double>> iodine_mg_ml_;
  int injected_branch_ = -1;
  LaminarVessel::Source source_;
  std::vector<bool> is_upstream_;  ///< of the injection: all branches between the root and its branch
  double washed_out_mg_ = 0, time_s_ = 0;
};

}  // namespace xraycast
