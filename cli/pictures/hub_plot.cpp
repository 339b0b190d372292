#include "pictures/hub_plot.hpp"

#include "pictures/plot.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace xraycast::cli {

HubPlot::HubPlot(const Script& script) {
  constexpr double kFinest_s = 0.01, kMaxPoints = 2000;
  interval_s_ = std::max(kFinest_s, script.rows().back().time_s / kMaxPoints);
}

void HubPlot::see(const Instruments& devices, double time_s) {
  if (!records_.empty() && time_s < records_[0].back().time_s + interval_s_) return;
  const std::vector<RunRecord> now = records_of(devices, time_s);
  records_.resize(now.size());
  for (std::size_t d = 0; d < now.size(); ++d) records_[d].push_back(now[d]);
}

void HubPlot::write(const std::vector<InstrumentModel>& devices, const std::string& first) const {
  const std::vector<std::filesystem::path> files = paths(first, devices.size());
  for (std::size_t d = 0; d < files.size(); ++d)
    write_hub_plot(fmt::format("{}: at the hub", devices[d].name()), records_[d], files[d]);
}

std::vector<std::filesystem::path> HubPlot::paths(const std::string& first, std::size_t devices) {
  if (first.empty()) return {};
  std::vector<std::filesystem::path> paths{first};
  for (std::size_t d = 2; d <= devices; ++d)
    paths.push_back(paths[0].parent_path() /
                    fmt::format("{}-{}{}", paths[0].stem().string(), d, paths[0].extension().string()));
  return paths;
}

void write_hub_plot(const std::string& title, const std::vector<RunRecord>& records,
                    const std::filesystem::path& path) {
  // The colours of an exported page, in web/src/page.css.
  constexpr Colour kForce{0.69, 0.16, 0.23}, kTorque{0.11, 0.42, 0.56};
  Curve force{"force, N", {}, kForce}, torque{"torque, N mm", {}, kTorque};
  for (const RunRecord& record : records) {
    force.points.emplace_back(record.time_s, record.load.force_N);
    torque.points.emplace_back(record.time_s, 1e3 * record.load.torque_Nm);
  }
  write_plot(title, "time (s)", "load", {force, torque}, path);
}

}  // namespace xraycast::cli
