#include "xraycast/simulation/tip_pressures.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace xraycast {

std::string in_words(const PressureReading& reading) {
  return fmt::format("{:.0f}/{:.0f} mmHg, mean {:.0f}", reading.systolic_mmHg, reading.diastolic_mmHg,
                     reading.mean_mmHg);
}

VesselTree::Location location_of(const InstrumentTip& tip) {
  VesselTree::Location location;
  location.branch = tip.branch;
  location.arc_length_mm = tip.arc_length_mm;
  return location;
}

std::vector<InstrumentTip> tips_of(const Instruments& instruments) {
  std::vector<InstrumentTip> tips;
  for (std::size_t d = 0; d < instruments.count(); ++d) tips.push_back(instruments.tip(d));
  return tips;
}

void TipPressures::add(double time_s, const TreeFlow& flow, const std::vector<InstrumentTip>& tips) {
  const double beat_s = flow.heart().period_s();
  aorta_.add(time_s, flow.aortic_mmHg(), beat_s);
  tips_.resize(tips.size());
  for (std::size_t d = 0; d < tips.size(); ++d)
    tips_[d].add(time_s, flow.pressure_mmHg(location_of(tips[d])), beat_s);
}

std::vector<double> TipPressures::tip_means_mmHg() const {
  std::vector<double> means_mmHg;
  for (const Line& line : tips_) means_mmHg.push_back(line.mean_mmHg());
  return means_mmHg;
}

void TipPressures::Line::add(double time_s, double mmHg, double kept_s) {
  samples_.emplace_back(time_s, mmHg);
  sum_mmHg_ += mmHg;
  while (samples_.front().first <= time_s - kept_s) {
    sum_mmHg_ -= samples_.front().second;
    samples_.pop_front();
  }
}

PressureReading TipPressures::Line::reading() const {
  if (samples_.empty()) return {};
  const auto [least, most] = std::minmax_element(
      samples_.begin(), samples_.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  return {samples_.back().second, most->second, least->second, mean_mmHg()};
}

}  // namespace xraycast
