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
  constexpr double kSameTime_s = 1e-9;
  const double beat_s = flow.heart().period_s();
  if (!are_read()) first_s_ = time_s;
  has_beat_ = time_s - first_s_ >= beat_s - kSameTime_s;
  aorta_.add(time_s, flow.aortic_mmHg(), beat_s);
  tips_.resize(tips.size());
  for (std::size_t d = 0; d < tips.size(); ++d)
    tips_[d].add(time_s, flow.pressure_mmHg(location_of(tips[d])), beat_s);
}

std::vector<double> TipPressures::tip_means_mmHg() const {
  std::vector<double> means_mmHg;
  if (!has_beat_) return means_mmHg;
  for (const Line& line : tips_) means_mmHg.push_back(line.mean_mmHg());
  return means_mmHg;
}

void TipPressures::Line::add(double time_s, double mmHg, double kept_s) {
  const Sample before = samples_.empty() ? Sample{time_s, mmHg, 0, mmHg} : samples_.back();
  samples_.push_back({time_s, mmHg, time_s - before.time_s, 0.5 * (before.mmHg + mmHg)});
  const auto count = [&](const Sample& sample, double sign) {
    sum_mmHg_s_ += sign * sample.mean_mmHg * sample.since_s;
    seconds_ += sign * sample.since_s;
  };
  count(samples_.back(), 1);
  while (samples_.front().time_s <= time_s - kept_s) {
    count(samples_.front(), -1);
    samples_.pop_front();
  }
  kept_s_ = kept_s;
}

double TipPressures::Line::mean_mmHg() const {
  // Of the first sample's time, a part lies before the heartbeat.
  const Sample& first = samples_.front();
  const double before_s = std::max(0.0, seconds_ - kept_s_), seconds = seconds_ - before_s;
  return seconds > 0 ? (sum_mmHg_s_ - before_s * first.mean_mmHg) / seconds : samples_.back().mmHg;
}

PressureReading TipPressures::Line::reading() const {
  if (samples_.empty()) return {};
  const auto [least, most] = std::minmax_element(
      samples_.begin(), samples_.end(), [](const Sample& a, const Sample& b) { return a.mmHg < b.mmHg; });
  return {samples_.back().mmHg, most->mmHg, least->mmHg, mean_mmHg()};
}

}  // namespace xraycast
