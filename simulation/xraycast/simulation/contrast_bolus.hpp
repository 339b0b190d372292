#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <vector>

namespace xraycast {

/// Advection of contrast agent by the blood through a vessel tree, from where it is injected downstream until
/// it washes out. Plug flow: in every segment of a branch, between two of its points, the agent is mixed
/// evenly and advected with the mean flow (implicit upwind steps, which conserve mass, are stable for
/// segments of any length, and disperse a bolus by some millimetres). Blood flows from the root to the
/// leaves; there is no retrograde flow.
class ContrastBolus {
 public:
  struct Blood {
    /// Mean over a heartbeat. 5 l/min through an aorta of 25 mm are 170 mm/s, and the mean velocities in the
    /// arteries that leave it are similar (Caro et al., The Mechanics of the Circulation, 2012), so that a
    /// bifurcation divides the flow by the cross-sections of its branches.
    double root_velocity_mm_s = 170;
  };

  ContrastBolus(const VesselTree& tree, const Blood& blood);
  explicit ContrastBolus(const VesselTree& tree) : ContrastBolus(tree, Blood{}) {}

  /// Advances by `time_s` (0 or more), while `injection_ml_s` (0 for none) of an agent of `agent_mg_ml`
  /// iodine is injected at a location of the tree. The injection adds to the flow downstream.
  void step(double time_s, const VesselTree::Location& tip, double injection_ml_s, double agent_mg_ml = 350);

  /// Iodine concentration in every branch's segments, one fewer than its points.
  const std::vector<std::vector<double>>& iodine_mg_ml() const { return iodine_mg_ml_; }

  /// Iodine that has left the tree through its leaves.
  double washed_out_mg() const { return washed_out_mg_; }

 private:
  void set_flow(const VesselTree::Location& tip, double injection_ml_s);
  void advect(double time_s);

  const VesselTree& tree_;
  std::vector<int> order_;                         ///< branches, parents first
  std::vector<double> blood_ml_s_;                 ///< of every branch, without the injection
  std::vector<std::vector<double>> volumes_ml_;    ///< of every segment
  std::vector<std::vector<double>> flow_ml_s_;     ///< out of every segment
  std::vector<std::vector<double>> iodine_mg_ml_;  ///< in every segment
  int injected_branch_ = -1;
  std::size_t injected_segment_ = 0;
  double injected_mg_s_ = 0, washed_out_mg_ = 0;
};

}  // namespace xraycast
