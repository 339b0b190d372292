#include "xraycast/simulation/run_script.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/negative_zero.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace xraycast {

namespace {

RunRecord record_of(double time_s, const HubPose& pose, const HubLoad& load, const InstrumentTip& tip,
                    const WallContact& wall) {
  RunRecord record{.time_s = time_s, .pose = pose, .load = load, .tip = tip};
  for (const WallContact::Contact& contact : wall.contacts()) {
    if (contact.depth_mm <= 0) continue;
    ++record.contacts;
    record.contact_force_N += (contact.normal_N + contact.friction_N).norm();
    record.deepest_mm = std::max(record.deepest_mm, contact.depth_mm);
  }
  return record;
}

void check_length(const Script::Row& row, std::size_t device, const InstrumentModel& instrument,
                  double max_insertion_mm, const std::string& name) {
  if (row.pose_of(device).insertion_mm > max_insertion_mm)
    throw InputError("{}: line {}: {} {}; {} can be inserted by at most {:.0f} mm", name, row.line,
                     device == 0 ? "insertion_mm" : fmt::format("insertion_{}_mm", device + 1),
                     row.pose_of(device).insertion_mm, instrument.name(), max_insertion_mm);
}

/// Steps through a script's rows; `step` takes a time of the script, `record` a row.
void follow(const Script& script, double step_s, Progress& progress,
            const std::function<void(double time_s)>& step,
            const std::function<void(const Script::Row& row)>& record) {
  long steps = 0;
  // Times of steps and rows differ by rounding.
  constexpr double kRounding_s = 1e-9;
  progress.begin("simulating", static_cast<std::int64_t>(script.rows().size()), "rows");
  for (const Script::Row& row : script.rows()) {
    while (static_cast<double>(steps) * step_s < row.time_s - kRounding_s) {
      progress.check();
      ++steps;
      step(static_cast<double>(steps) * step_s);
    }
    record(row);
    progress.advance();
  }
}

bool is_at(const HubPose& hub, const HubPose& pose) {
  return hub.insertion_mm == pose.insertion_mm && hub.rotation_rad == pose.rotation_rad;
}

/// Watches hubs on their way to a row's poses.
class Approach {
 public:
  Approach(const Script::Row& row, std::size_t devices)
      : row_(row), nearest_mm_(devices, std::numeric_limits<double>::infinity()), since_s_(devices) {}

  bool is_over(const Instruments& devices) const {
    for (std::size_t d = 0; d < devices.count(); ++d)
      if (!is_at(devices.pose(d), row_.pose_of(d))) return false;
    return true;
  }

  /// Throws InputError when a hub has come no nearer for long.
  void check(const Instruments& devices, double time_s, const std::string& name) {
    constexpr double kLongest_s = 5, kNearer_mm = 0.1;
    for (std::size_t d = 0; d < devices.count(); ++d) {
      const double insertion_mm = devices.pose(d).insertion_mm;
      const double left_mm = std::abs(row_.pose_of(d).insertion_mm - insertion_mm);
      if (left_mm < nearest_mm_[d] - kNearer_mm || left_mm == 0) {
        nearest_mm_[d] = left_mm;
        since_s_[d] = time_s;
      } else if (time_s - since_s_[d] > kLongest_s) {
        throw InputError(
            "{}: line {}: {} stops at {:.0f} of {:.0f} mm, where {:g} N do not push it further; "
            "begin with less",
            name, row_.line, devices.rod(d).instrument().name(), insertion_mm, row_.pose_of(d).insertion_mm,
            MovingHub::kMaxPush_N);
      }
    }
  }

 private:
  const Script::Row& row_;
  std::vector<double> nearest_mm_, since_s_;  ///< of each device
};

constexpr const char* kColumns =
    "insertion{0}_mm,rotation{0}_deg,force{0}_N,torque{0}_Nm,tip{0}_x_mm,tip{0}_y_mm,tip{0}_z_mm,tip{0}_"
    "direction_x,tip{0}_direction_y,tip{0}_direction_z,tip{0}_branch,tip{0}_arc_length_mm,contacts{0},"
    "contact_force{0}_N,deepest{0}_mm";

std::string values_of(const RunRecord& r) {
  constexpr int kDecimals = 6;
  const auto part = [](double value) { return no_negative_zero(value, kDecimals); };
  const glm::dvec3 &p = r.tip.position_mm, &d = r.tip.direction;
  // A sum with +0 is never -0.
  return fmt::format(
      "{:.6g},{:.6g},{:.6g},{:.6g},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{},{:.6f},{},{:.6g},{:.6g}",
      r.pose.insertion_mm + 0.0, r.pose.rotation_rad * 180 / std::numbers::pi + 0.0, r.load.force_N + 0.0,
      r.load.torque_Nm + 0.0, part(p.x), part(p.y), part(p.z), part(d.x), part(d.y), part(d.z), r.tip.branch,
      part(r.tip.arc_length_mm), r.contacts, r.contact_force_N, r.deepest_mm);
}

std::string columns_of(std::size_t device) {
  return fmt::format(fmt::runtime(kColumns), device == 0 ? "" : fmt::format("_{}", device + 1));
}

}  // namespace

std::vector<RunRecord> records_of(const Instruments& devices, double time_s) {
  std::vector<RunRecord> records;
  for (std::size_t d = 0; d < devices.count(); ++d)
    records.push_back(record_of(time_s, devices.pose(d), devices.load(d), devices.tip(d), devices.wall(d)));
  return records;
}

std::vector<std::vector<RunRecord>> run_script(
    Instruments& devices, const Script& script, const std::string& name, Progress& progress,
    const std::function<void(const Instruments&, double)>& after_step) {
  for (const Script::Row& row : script.rows())
    for (std::size_t d = 0; d < devices.count(); ++d)
      check_length(row, d, devices.rod(d).instrument(), devices.max_insertion_mm(d), name);
  std::vector<HubPose> poses(devices.count());
  const auto move_to = [&](double time_s) {
    for (std::size_t d = 0; d < poses.size(); ++d) poses[d] = script.pose_at(time_s, d);
    devices.step(poses);
  };
  const Script::Row& first = script.rows().front();
  Approach approach(first, devices.count());
  while (!approach.is_over(devices)) {
    progress.check();
    move_to(first.time_s);
    approach.check(devices, devices.time_s(), name);
  }

  std::vector<std::vector<RunRecord>> records;
  const auto step = [&](double time_s) {
    move_to(time_s);
    if (after_step) after_step(devices, time_s);
  };
  follow(script, devices.step_s(), progress, step,
         [&](const Script::Row& row) { records.push_back(records_of(devices, row.time_s)); });
  return records;
}

std::string to_csv(const std::vector<std::vector<RunRecord>>& records) {
  std::string csv = "time_s";
  for (std::size_t d = 0; !records.empty() && d < records.front().size(); ++d)
    csv += fmt::format(",{}", columns_of(d));
  csv += '\n';
  for (const std::vector<RunRecord>& row : records) {
    csv += fmt::format("{:.6g}", row.front().time_s);
    for (const RunRecord& record : row) csv += fmt::format(",{}", values_of(record));
    csv += '\n';
  }
  return csv;
}

}  // namespace xraycast
