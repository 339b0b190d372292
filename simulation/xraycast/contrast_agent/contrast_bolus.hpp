#pragma once

#include "xraycast/blood_flow/tree_flow.hpp"
#include "xraycast/contrast_agent/laminar_vessel.hpp"
#include "xraycast/contrast_agent/mixed_sac.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <vector>

namespace xraycast {

/// Transport of iodine by the blood through a vessel tree, from where contrast agent is injected until it
/// washes out.
///
/// Flow: a TreeFlow's, of which an injection is a source: it takes the place of blood that would come from
/// the root, as the resistance of the periphery is far above that of the tree. Where it exceeds the flow, the
/// rest refluxes towards the root, and from there into other branches (as seen by Kovarovic et al.,
/// Cardiovasc Eng Technol 9:226, 2018).
///
/// Transport: a LaminarVessel for every branch. Its profile's exponent is the Womersley number, the ratio of
/// the radius to the thickness of the oscillating boundary layer, between 2, a parabola, and 9, as measured
/// in arteries (Smith et al., SIAM J Appl Math 62:990, 2002). At bifurcations the laminae mix. In arteries
/// the time of Taylor's dispersion is minutes, so that a bolus spreads by the profile's shear.
/// An aneurysm is a MixedSac at the bifurcation where it leaves its vessel.
class ContrastBolus {
 public:
  ContrastBolus(const VesselTree& tree, const Blood& blood);
  explicit ContrastBolus(const VesselTree& tree) : ContrastBolus(tree, Blood{}) {}

  /// Advances by `time_s` (0 or more), while `injection_ml_s` (0 for none) of an agent of `agent_mg_ml`
  /// iodine is injected at a location of the tree.
  void step(double time_s, const VesselTree::Location& tip, double injection_ml_s, double agent_mg_ml = 350,
            const Particles& particles = {});

  /// The vessels have other radii, as where walls have yielded: those of a tree with the same points. Iodine
  /// stays where it is, in more or less blood, and the blood flows as the new radii let it.
  void take_radii(const VesselTree& tree);

  /// The coils in a sac of flow().sacs() from now on, among which there is less room for blood.
  void pack(std::size_t sac, const CoilBed& bed);

  /// Iodine concentration in every branch's segments, one fewer than its points.
  const std::vector<std::vector<double>>& iodine_mg_ml() const { return iodine_mg_ml_; }

  double in_tree_mg() const;

  /// Iodine that has left the tree: through its leaves, and where it refluxes through its root.
  double washed_out_mg() const { return washed_out_mg_; }

  /// The blood's mean flow through a branch at rest, without an injection, a stenosis or an instrument.
  double mean_flow_ml_s(int branch) const { return flow_.rest_ml_s(static_cast<std::size_t>(branch)); }

  /// What moves it: for pressures, and for what narrows the vessels.
  const TreeFlow& flow() const { return flow_; }
  TreeFlow& flow() { return flow_; }

 private:
  /// A branch's end, or the root's start.
  struct Junction {
    double entering_mg = 0, leaving_ml = 0;  ///< in a step, into vessels and the periphery
    double mg_ml() const { return leaving_ml > 0 ? entering_mg / leaving_ml : 0; }
  };

  const MixedSac* sac_at(std::size_t branch) const;
  void copy_means();
  double longest_step_s() const;
  void set_flow(const VesselTree::Location& tip, double ml_s, double mg_ml);
  void advect(double time_s);

  const VesselTree& tree_;
  TreeFlow flow_;
  std::vector<LaminarVessel> vessels_;  ///< those of sacs stay empty
  std::vector<MixedSac> sacs_;          ///< of flow_.sacs()
  std::vector<Junction> junctions_;     ///< the branches' ends, then the root's start
  std::vector<std::vector<double>> iodine_mg_ml_;
  LaminarVessel::Source source_;
  double washed_out_mg_ = 0;
};

}  // namespace xraycast
