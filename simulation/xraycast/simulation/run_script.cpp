#include "xraycast/simulation/run_script.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {

RunRecord record_of(const Catheter& catheter, double time_s) {
  RunRecord record;
  record.time_s = time_s;
  record.pose = catheter.pose();
  record.load = catheter.load();
  record.tip = catheter.tip();
  for (const WallContact::Contact& contact : catheter.wall().contacts()) {
    if (contact.depth_mm <= 0) continue;
    ++record.contacts;
    record.contact_force_N += (contact.normal_N + contact.friction_N).norm();
    record.deepest_mm = std::max(record.deepest_mm, contact.depth_mm);
  }
  return record;
}

std::vector<RunRecord> run_script(Catheter& catheter, const Script& script, const std::string& name,
                                  Progress& progress,
                                  const std::function<void(const Catheter&, double)>& after_step) {
  for (const Script::Row& row : script.rows())
    if (row.pose.insertion_mm > catheter.max_insertion_mm())
      throw InputError("{}: line {}: insertion_mm {}; {} can be inserted by at most {:.0f} mm", name,
                       row.line, row.pose.insertion_mm, catheter.rod().instrument().name(),
                       catheter.max_insertion_mm());

  const HubPose& first = script.rows().front().pose;
  while (catheter.pose().insertion_mm != first.insertion_mm ||
         catheter.pose().rotation_rad != first.rotation_rad) {
    progress.check();
    catheter.step(first);
  }

  std::vector<RunRecord> records;
  long steps = 0;
  // Times of steps and rows differ by rounding.
  constexpr double kRounding_s = 1e-9;
  progress.begin("simulating", static_cast<std::int64_t>(script.rows().size()), "rows");
  for (const Script::Row& row : script.rows()) {
    while (static_cast<double>(steps) * catheter.step_s() < row.time_s - kRounding_s) {
      progress.check();
      ++steps;
      const double time_s = static_cast<double>(steps) * catheter.step_s();
      catheter.step(script.pose_at(time_s));
      if (after_step) after_step(catheter, time_s);
    }
    records.push_back(record_of(catheter, row.time_s));
    progress.advance();
  }
  return records;
}

std::string to_csv(const std::vector<RunRecord>& records) {
  std::string csv =
      "time_s,insertion_mm,rotation_deg,force_N,torque_Nm,tip_x_mm,tip_y_mm,tip_z_mm,tip_direction_x,"
      "tip_direction_y,tip_direction_z,tip_branch,tip_arc_length_mm,contacts,contact_force_N,deepest_mm\n";
  for (const RunRecord& r : records) {
    const glm::dvec3 &p = r.tip.position_mm, &d = r.tip.direction;
    csv += fmt::format(
        "{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{},{:.6f},{},{:.6g},{:."
        "6g}\n",
        r.time_s, r.pose.insertion_mm, r.pose.rotation_rad * 180 / std::numbers::pi, r.load.force_N,
        r.load.torque_Nm, p.x, p.y, p.z, d.x, d.y, d.z, r.tip.branch, r.tip.arc_length_mm, r.contacts,
        r.contact_force_N, r.deepest_mm);
  }
  return csv;
}

}  // namespace xraycast
