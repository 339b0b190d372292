#include "xraycast/simulation/run_script.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {

namespace {

RunRecord record_of(double time_s, const HubPose& pose, const HubLoad& load, const CatheterTip& tip,
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

constexpr const char* kColumns =
    "insertion{0}_mm,rotation{0}_deg,force{0}_N,torque{0}_Nm,tip{0}_x_mm,tip{0}_y_mm,tip{0}_z_mm,tip{0}_"
    "direction_x,tip{0}_direction_y,tip{0}_direction_z,tip{0}_branch,tip{0}_arc_length_mm,contacts{0},"
    "contact_"
    "force{0}_N,deepest{0}_mm";

std::string values_of(const RunRecord& r) {
  const glm::dvec3 &p = r.tip.position_mm, &d = r.tip.direction;
  return fmt::format(
      "{:.6g},{:.6g},{:.6g},{:.6g},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{},{:.6f},{},{:.6g},{:.6g}",
      r.pose.insertion_mm, r.pose.rotation_rad * 180 / std::numbers::pi, r.load.force_N, r.load.torque_Nm,
      p.x, p.y, p.z, d.x, d.y, d.z, r.tip.branch, r.tip.arc_length_mm, r.contacts, r.contact_force_N,
      r.deepest_mm);
}

std::string columns_of(std::size_t device) {
  return fmt::format(fmt::runtime(kColumns), device == 0 ? "" : fmt::format("_{}", device + 1));
}

}  // namespace

RunRecord record_of(const Catheter& catheter, double time_s) {
  return record_of(time_s, catheter.pose(), catheter.load(), catheter.tip(), catheter.wall());
}

std::vector<RunRecord> records_of(const Catheter& catheter, double time_s) {
  return {record_of(catheter, time_s)};
}

std::vector<RunRecord> records_of(const CoaxialCatheters& devices, double time_s) {
  std::vector<RunRecord> records;
  for (std::size_t d = 0; d < devices.count(); ++d)
    records.push_back(record_of(time_s, devices.pose(d), devices.load(d), devices.tip(d), devices.wall(d)));
  return records;
}

std::vector<RunRecord> run_script(Catheter& catheter, const Script& script, const std::string& name,
                                  Progress& progress,
                                  const std::function<void(const Catheter&, double)>& after_step) {
  for (const Script::Row& row : script.rows())
    check_length(row, 0, catheter.rod().instrument(), catheter.max_insertion_mm(), name);
  while (!is_at(catheter.pose(), script.rows().front().pose)) {
    progress.check();
    catheter.step(script.rows().front().pose);
  }

  std::vector<RunRecord> records;
  const auto step = [&](double time_s) {
    catheter.step(script.pose_at(time_s));
    if (after_step) after_step(catheter, time_s);
  };
  follow(script, catheter.step_s(), progress, step,
         [&](const Script::Row& row) { records.push_back(record_of(catheter, row.time_s)); });
  return records;
}

std::vector<std::vector<RunRecord>> run_script(
    CoaxialCatheters& devices, const Script& script, const std::string& name, Progress& progress,
    const std::function<void(const CoaxialCatheters&, double)>& after_step) {
  for (const Script::Row& row : script.rows())
    for (std::size_t d = 0; d < devices.count(); ++d)
      check_length(row, d, devices.rod(d).instrument(), devices.max_insertion_mm(d), name);
  std::vector<HubPose> poses(devices.count());
  const auto move_to = [&](double time_s) {
    for (std::size_t d = 0; d < poses.size(); ++d) poses[d] = script.pose_at(time_s, d);
    devices.step(poses);
  };
  const auto is_ready = [&] {
    for (std::size_t d = 0; d < poses.size(); ++d)
      if (!is_at(devices.pose(d), script.rows().front().pose_of(d))) return false;
    return true;
  };
  while (!is_ready()) {
    progress.check();
    move_to(script.rows().front().time_s);
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

std::string to_csv(const std::vector<RunRecord>& records) {
  std::string csv = fmt::format("time_s,{}\n", columns_of(0));
  for (const RunRecord& record : records) csv += fmt::format("{:.6g},{}\n", record.time_s, values_of(record));
  return csv;
}

}  // namespace xraycast
