#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/blood_flow/blood.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

namespace xraycast {

/// A heartbeat of the blood in a vessel tree.
struct FlowRequest {
  std::shared_ptr<const VesselTree> tree{};
  Blood blood{};
};

/// Throws InputError for no tree, and as check of Blood.
void check(const FlowRequest& request);

/// What a value was over a heartbeat.
struct CycleFigures {
  double mean = 0, least = 0, most = 0;
};

/// Pressures and flows over a heartbeat, which is like all others.
struct FlowCycle {
  static constexpr double kStep_s = 1e-3;  ///< between samples, at most
  struct Vessel {
    /// Through its start, away from the root; of an aneurysm's sac, what enters it, and as much leaves it.
    std::vector<double> ml_s;
    std::vector<double> mmHg;  ///< at its end
  };
  std::vector<double> time_s;       ///< since the ejection began, or the waveform
  std::vector<double> aortic_mmHg;  ///< before the root
  double heart_ml_s = 0;            ///< the heart's output
  std::vector<Vessel> vessels;      ///< of every branch
  std::vector<std::string> notes;   ///< on a root that is no place where blood enters a body, a line each

  /// The mean pressure at a branch's end over the aorta's: at hyperaemia, the fractional flow reserve (Pijls
  /// et al., N Engl J Med 334:1703, 1996).
  double pressure_ratio(std::size_t branch) const;
};

/// Throws as check(), and Cancelled.
FlowCycle flow_cycle(const FlowRequest& request, Progress& progress);

/// Of equally spaced values.
CycleFigures figures_of(const std::vector<double>& values);

/// The fractional flow reserve at a place of a tree: its mean pressure over the aorta's while the coronary
/// periphery has kHyperaemia of its resistance.
double fractional_flow_reserve(const VesselTree& tree, const VesselTree::Location& place, Blood blood = {});

/// CSV: a line a branch: branch, vessel, its flow's mean, least and most in ml/s, the mean's share of the
/// heart's output, the pressure at its end in mmHg, and its pressure ratio.
std::string to_csv(const FlowCycle& cycle, const VesselTree& tree);

}  // namespace xraycast
