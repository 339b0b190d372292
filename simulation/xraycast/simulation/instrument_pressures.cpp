#include "xraycast/simulation/instrument_pressures.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace xraycast {

std::vector<TreeFlow::Filling> fillings_of(const VesselTree& tree, const VesselEnd& entry,
                                           const InstrumentTip& tip, double radius_mm) {
  const auto& branches = tree.branches();
  const auto parent_of = [&](int branch) { return branches[static_cast<std::size_t>(branch)].parent; };
  const auto way_up = [&](int branch) {
    std::vector<int> way;
    for (; branch >= 0; branch = parent_of(branch)) way.push_back(branch);
    return way;
  };
  // Up from the tip and from the entry to where both ways meet, in a branch that both have or at its end.
  std::vector<int> from_tip = way_up(tip.branch), from_entry = way_up(entry.branch);
  std::optional<int> common;
  while (!from_tip.empty() && !from_entry.empty() && from_tip.back() == from_entry.back()) {
    common = from_tip.back();
    from_tip.pop_back();
    from_entry.pop_back();
  }
  const auto length_mm = [&](int branch) {
    return branches[static_cast<std::size_t>(branch)].arc_length_mm.back();
  };
  std::vector<TreeFlow::Filling> fillings;
  const auto fill = [&](int branch, double from_mm, double to_mm) {
    fillings.push_back({branch, std::min(from_mm, to_mm), std::max(from_mm, to_mm), radius_mm});
  };
  for (const int branch : from_entry) fill(branch, 0, length_mm(branch));
  for (const int branch : from_tip)
    fill(branch, 0, branch == tip.branch ? tip.arc_length_mm : length_mm(branch));
  if (!common) return fillings;
  // In the branch that both have: from the root's start or from its own end, to the tip or to its own end.
  const double entry_mm = entry.at_start ? 0 : length_mm(*common);
  const double tip_mm = from_tip.empty() ? tip.arc_length_mm : length_mm(*common);
  if (entry_mm != tip_mm) fill(*common, entry_mm, tip_mm);
  return fillings;
}

std::vector<TreeFlow::Filling> fillings_of(std::span<const YieldingWalls::Opening> balloon_lengths) {
  std::vector<TreeFlow::Filling> fillings;
  for (const YieldingWalls::Opening& length : balloon_lengths)
    fillings.push_back({length.branch, length.from_mm, length.to_mm, length.radius_mm});
  return fillings;
}

std::vector<TreeFlow::Filling> fillings_of(const VesselTree& tree, const Instruments& instruments) {
  std::vector<TreeFlow::Filling> all;
  for (std::size_t d = 0; d < instruments.count(); ++d) {
    if (instruments.pose(d).insertion_mm <= 0) continue;
    const double radius_mm = instruments.rod(d).instrument().radius_mm();
    for (const TreeFlow::Filling& filling :
         fillings_of(tree, instruments.entry(), instruments.tip(d), radius_mm))
      all.push_back(filling);
    for (const TreeFlow::Filling& filling : fillings_of(instruments.balloon_lengths(d)))
      all.push_back(filling);
  }
  return all;
}

/// Where walls have yielded.
void InstrumentPressures::take_vessels(const Instruments& instruments) {
  if (instruments.vessel_changes() == vessel_changes_) return;
  vessel_changes_ = instruments.vessel_changes();
  flow_.set_lumens(instruments.widened_tree());
}

void InstrumentPressures::advance(const Instruments& instruments, double time_s, const Injection& injection) {
  constexpr double kRounding_s = 1e-9, kFilledEvery_s = 0.01;  // in which a hub moves by a millimetre at most
  if (!readings_.are_read()) readings_.add(time_s, flow_, tips_of(instruments));
  if (time_s - time_s_ < TreeFlow::kLongestStep_s - kRounding_s) return;
  if (filled_s_ < 0 || time_s - filled_s_ >= kFilledEvery_s - kRounding_s) {
    take_vessels(instruments);
    flow_.fill(fillings_of(tree_, instruments));
    filled_s_ = time_s;
  }
  const std::optional<std::size_t> outlet = agent_outlet(instruments);
  const Particles particles = injection.particles.through(agent_lumen_mm(instruments));
  injected_.advance(instruments, time_s, injection);
  const double rate_ml_s = outlet ? injection.mean_rate_ml_s(time_s_, time_s) : 0;
  const double steps = std::ceil((time_s - time_s_ - kRounding_s) / TreeFlow::kLongestStep_s);
  for (double i = 0; i < steps; ++i)
    flow_.step((time_s - time_s_) / steps, location_of(instruments.tip(outlet.value_or(0))), rate_ml_s,
               particles);
  time_s_ = time_s;
  readings_.add(time_s, flow_, tips_of(instruments));
}

}  // namespace xraycast
