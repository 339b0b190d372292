#pragma once

#include "xraycast/blood_flow/tree_flow.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/contrast_agent/agent_outlet.hpp"
#include "xraycast/contrast_agent/injection.hpp"
#include "xraycast/simulation/tip_pressures.hpp"

#include <cstddef>
#include <span>
#include <vector>

namespace xraycast {

/// The lumens in which an instrument lies: it follows the tree from the end where it entered to its tip.
std::vector<TreeFlow::Filling> fillings_of(const VesselTree& tree, const VesselEnd& entry,
                                           const InstrumentTip& tip, double radius_mm);

/// What a balloon takes of the vessels that it lies in: see Instruments::balloon_lengths.
std::vector<TreeFlow::Filling> fillings_of(std::span<const YieldingWalls::Opening> balloon_lengths);

/// Of all instruments and their balloons.
std::vector<TreeFlow::Filling> fillings_of(const VesselTree& tree, const Instruments& instruments);

/// The pressure of the blood at the tips of instruments, as they move through a tree, balloons fill and open
/// its vessels, and agent is injected through them.
class InstrumentPressures {
 public:
  /// The tree must outlive it. Throws as TreeFlow.
  InstrumentPressures(const VesselTree& tree, const Blood& blood) : tree_(tree), flow_(tree, blood) {}

  /// Lets the blood flow on to a time, in steps of TreeFlow::kLongestStep_s; where less has passed it waits.
  void advance(const Instruments& instruments, double time_s, const Injection& injection);

  double aortic_mmHg() const { return flow_.aortic_mmHg(); }
  const Embolisation& embolisation() const { return flow_.embolisation(); }
  const InjectedVolume& injected() const { return injected_; }
  const TipPressures& readings() const { return readings_; }
  double tip_mmHg(const Instruments& instruments, std::size_t instrument) const {
    return flow_.pressure_mmHg(location_of(instruments.tip(instrument)));
  }

 private:
  void take_vessels(const Instruments& instruments);

  const VesselTree& tree_;
  TreeFlow flow_;
  InjectedVolume injected_;
  TipPressures readings_;
  double time_s_ = 0, filled_s_ = -1;
  long vessel_changes_ = 0;  ///< that the flow knows of; see Instruments
};

}  // namespace xraycast
