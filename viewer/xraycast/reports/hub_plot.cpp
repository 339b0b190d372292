#include "xraycast/reports/hub_plot.hpp"

#include "xraycast/reports/plot.hpp"

#include <algorithm>

namespace xraycast {

HubSamples::HubSamples(const Script& script) {
  constexpr double kFinest_s = 0.01, kMaxPoints = 2000;
  interval_s_ = std::max(kFinest_s, script.rows().back().time_s / kMaxPoints);
}

void HubSamples::record(const Instruments& instruments, double time_s) {
  if (records_.empty() || time_s >= records_.back()[0].time_s + interval_s_)
    records_.push_back(records_of(instruments, time_s));
}

RgbPicture hub_plot(const std::string& title, const std::vector<std::vector<RunRecord>>& records,
                    std::size_t instrument) {
  // The colours of an exported page, in web/src/page.css.
  constexpr Colour kForce{0.69, 0.16, 0.23}, kTorque{0.11, 0.42, 0.56};
  Curve force{"force, N", {}, kForce}, torque{"torque, N mm", {}, kTorque};
  for (const std::vector<RunRecord>& of_instruments : records) {
    const RunRecord& record = of_instruments[instrument];
    force.points.emplace_back(record.time_s, record.load.force_N);
    torque.points.emplace_back(record.time_s, 1e3 * record.load.torque_Nm);
  }
  return plot(title, "time (s)", "load", {force, torque});
}

}  // namespace xraycast
