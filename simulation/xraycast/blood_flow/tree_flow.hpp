#pragma once

#include "xraycast/blood_flow/blood.hpp"
#include "xraycast/blood_flow/embolisation.hpp"
#include "xraycast/blood_flow/flow_network.hpp"
#include "xraycast/blood_flow/heartbeat.hpp"
#include "xraycast/blood_flow/rest_flow.hpp"
#include "xraycast/blood_flow/sac_inflow.hpp"
#include "xraycast/blood_flow/vessel_impedance.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <cstddef>
#include <optional>
#include <vector>

namespace xraycast {

/// Pressure and flow of the blood in a vessel tree, over heartbeats.
///
/// The heart ejects into the aorta, from which the tree and the rest of the body are supplied. Aorta and
/// peripheral arteries store blood (a windkessel whose time constant is 1.4 s: Stergiopulos et al., Am J
/// Physiol 276:H81, 1999); the tree's own vessels are rigid, with Womersley's impedance (VesselImpedance,
/// FlowNetwork). Behind each leaf an arteriole's impedance, a compliance and the periphery's resistance
/// follow, or a coronary circulation in a heart's wall that contracts (Kim et al., Ann Biomed Eng 38:3195,
/// 2010). They are such that a healthy tree at rest has the flow of rest_flow at a mean aortic pressure of 93
/// mmHg; a stenosis lowers it.
class TreeFlow {
 public:
  static constexpr double kAortic_mmHg = 93, kVenous_mmHg = 5;
  /// Longer steps blur the ejection, which lasts for 0.3 s.
  static constexpr double kLongestStep_s = 2e-3;

  /// The tree must outlive it. Throws as check of Blood.
  TreeFlow(const VesselTree& tree, const Blood& blood);

  /// Advances by a time above 0, at most kLongestStep_s, while so much is injected at a place of the tree,
  /// with particles in it.
  void step(double time_s, const VesselTree::Location& tip, double injection_ml_s,
            const Particles& particles = {});

  /// Through the ends of a branch in the last step, in its mean, away from the root. They differ by what is
  /// injected in it.
  double start_ml_s(std::size_t branch) const { return network_.mean_flow(upper_[branch]); }
  double end_ml_s(std::size_t branch) const { return network_.mean_flow(upper_[branch] + 1); }
  /// The same at rest in the healthy tree.
  double rest_ml_s(std::size_t branch) const { return rest_.ml_s[branch]; }
  /// Blood leaves the tree through its end.
  bool is_outlet(std::size_t branch) const { return rest_.is_outlet[branch]; }
  /// The largest one over a beat of this tree, either way, without an injection.
  double peak_ml_s(std::size_t branch) const { return peak_ml_s_[branch]; }

  /// The sacs of aneurysms, through which nothing flows but what is injected in them, and what each exchanges
  /// with the vessel that it leaves in the last step; see sac_inflow_ml_s.
  const std::vector<AneurysmSac>& sacs() const { return sacs_; }
  double sac_ml_s(std::size_t sac) const;
  /// The coils in it from now on.
  void pack(std::size_t sac, const CoilBed& bed) { beds_[sac] = bed; }
  const CoilBed& bed(std::size_t sac) const { return beds_[sac]; }

  /// At the end of the last step.
  double aortic_mmHg() const { return network_.pressure(0); }
  double pressure_mmHg(const VesselTree::Location& place) const;

  double time_s() const { return time_s_; }  ///< since a beat began
  const Heartbeat& heart() const { return heart_; }
  double heart_ml_s() const { return output_ml_s_; }  ///< its mean

  /// An instrument in the lumen of a branch.
  struct Filling {
    int branch = 0;
    double from_mm = 0, to_mm = 0;  ///< of its arc length
    double radius_mm = 0;
  };
  /// Those that narrow the tree from the next step on.
  void fill(const std::vector<Filling>& fillings);

  /// Other radii of a branch's points from the next step on, as a balloon or a stent leaves them.
  void set_lumen(std::size_t branch, const std::vector<double>& radii_mm);
  /// Those of all branches, of a tree with the same points.
  void set_lumens(const VesselTree& tree);
  /// How much of a branch's conductance is left: 0 closes it, as a balloon does.
  void set_conductance(std::size_t branch, double share);
  /// How much of the periphery's conductance behind a leaf is left. Nothing for a sac.
  void set_periphery(std::size_t leaf, double share);
  /// What injected particles have closed of it; those of a heartbeat lodge at its end.
  const Embolisation& embolisation() const { return embolisation_; }

 private:
  std::vector<FlowNode> nodes_of(const Blood& blood);
  void add_outlet(std::vector<FlowNode>& nodes, std::size_t branch, double mmHg, double factor);
  void divide(std::size_t branch, double arc_length_mm);
  void beat(double begin_s, double end_s);
  void begin();
  void carry(const Particles& particles, double count, std::size_t branch, double time_s);
  void lodge();

  /// A periphery whose compliance a heart's wall presses.
  struct Wall {
    std::size_t node;
    double most_mmHg;
  };

  const VesselTree& tree_;
  Heartbeat heart_;
  double output_ml_s_;  ///< the heart's
  RestFlow rest_;
  std::vector<AneurysmSac> sacs_;
  std::vector<CoilBed> beds_;  ///< of each sac
  std::vector<VesselImpedance> impedances_;
  std::vector<double> divided_mm_;   ///< where each branch's inner node lies
  std::vector<std::size_t> upper_;   ///< of each branch, its inner node; its end is the next one
  std::vector<std::size_t> behind_;  ///< of each leaf, the first node of the periphery; 0: none
  std::vector<double> share_;        ///< of each branch's conductance
  std::vector<Filling> fillings_;
  std::vector<double> peak_ml_s_;
  std::vector<Wall> walls_;
  Embolisation embolisation_;
  /// Particles of the heartbeat so far, and the blood's way in it, in ml.
  struct OnTheWay {
    double count = 0, diameter_mm = 0, time_s = 0;
    std::size_t branch = 0;
    Embolisation::Flows ml{};
  };
  OnTheWay on_the_way_;
  FlowNetwork network_;
  std::optional<std::size_t> injected_;  ///< the node
  double time_s_ = 0;
};

}  // namespace xraycast
