#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <vector>

namespace xraycast {

/// Contrast agent that is carried through a vessel tree by the blood, from where it is injected downstream,
/// and washes out. Plug flow: in every stretch of a branch, between two of its points, the agent is mixed
/// evenly and moves on with the mean flow (implicit upwind steps, which conserve mass, are stable for
/// stretches of any length, and spread a bolus by some millimetres). Blood runs from the root to the leaves;
/// none runs back.
class ContrastBolus {
 public:
  struct Blood {
    /// Mean over a heartbeat. 5 l/min through an aorta of 25 mm are 170 mm/s, and the mean velocities in the
    /// arteries that leave it are alike (Caro et al., The Mechanics of the Circulation, 2012), so that a
    /// bifurcation divides the flow by the sections of its branches.
    double root_velocity_mm_s = 170;
  };

  ContrastBolus(const VesselTree& tree, const Blood& blood);
  explicit ContrastBolus(const VesselTree& tree) : ContrastBolus(tree, Blood{}) {}

  /// Lets `time_s` (0 or more) pass, while `injection_ml_s` (0 for none) of an agent of `agent_mg_ml` iodine
  /// enter at a place of the tree. What is injected adds to the flow downstream of there.
  void step(double time_s, const VesselTree::Location& tip, double injection_ml_s, double agent_mg_ml = 350);

  /// Of every branch's stretches, one fewer than its points: milligrams of iodine a millilitre.
  const std::vector<std::vector<double>>& iodine_mg_ml() const { return iodine_mg_ml_; }

  /// In the whole tree, and what has left it through its leaves.
  double iodine_mg() const;
  double washed_out_mg() const { return washed_out_mg_; }

 private:
  void set_flow(const VesselTree::Location& tip, double injection_ml_s);
  void carry(double time_s);

  const VesselTree& tree_;
  std::vector<int> order_;                         ///< branches, parents first
  std::vector<double> blood_ml_s_;                 ///< of every branch, without what is injected
  std::vector<std::vector<double>> volumes_ml_;    ///< of every stretch
  std::vector<std::vector<double>> flow_ml_s_;     ///< out of every stretch
  std::vector<std::vector<double>> iodine_mg_ml_;  ///< in every stretch
  int injected_branch_ = -1;
  std::size_t injected_stretch_ = 0;
  double injected_mg_s_ = 0, washed_out_mg_ = 0;
};

}  // namespace xraycast
