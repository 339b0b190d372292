#include "pictures/hub_plot.hpp"

#include "pictures/plot.hpp"

namespace xraycast::cli {

void write_hub_plot(const std::string& title, const std::vector<RunRecord>& records,
                    const std::filesystem::path& path) {
  Curve force{"force, N", {}}, torque{"torque, N mm", {}};
  for (const RunRecord& record : records) {
    force.points.emplace_back(record.time_s, record.load.force_N);
    torque.points.emplace_back(record.time_s, 1e3 * record.load.torque_Nm);
  }
  write_plot(title, "time (s)", "load", {force, torque}, path);
}

}  // namespace xraycast::cli
