#include "calls/run_records.hpp"

#include "calls/job.hpp"

#include <nanobind/stl/string.h>

namespace xraycast::python {
namespace {

/// As NumPy has it: eight bytes a number.
struct PackedRecord {
  double time_s, insertion_mm, rotation_deg, force_N, torque_Nm;
  glm::dvec3 tip_mm, tip_direction;
  std::int64_t branch;
  double arc_length_mm;
  std::int64_t contacts;
  double contact_force_N, deepest_mm;
  glm::dvec3 tip_scan_mm;
  double wall_work_J;
  double pressure_mmHg, aortic_mmHg;
};
static_assert(sizeof(PackedRecord) == 22 * 8);

PackedRecord packed(const RunRecord& r) {
  return {r.time_s,        r.pose.insertion_mm, r.pose.rotation_rad * kDegreesPerRadian,
          r.load.force_N,  r.load.torque_Nm,    r.tip.position_mm,
          r.tip.direction, r.tip.branch,        r.tip.arc_length_mm,
          r.contacts,      r.contact_force_N,   r.deepest_mm,
          r.tip.scan_mm,   r.wall_work_J,       r.pressure_mmHg,
          r.aortic_mmHg};
}

}  // namespace

nb::object records_array(const std::vector<std::vector<RunRecord>>& records) {
  Progress progress;
  const RunningCall call(progress);  // as poses_of
  std::vector<PackedRecord> all;
  for (const std::vector<RunRecord>& of_instruments : records)
    for (const RunRecord& record : of_instruments) all.push_back(packed(record));
  nb::list fields;
  for (const char* name : {"time_s", "insertion_mm", "rotation_deg", "force_N", "torque_Nm"})
    fields.append(nb::make_tuple(name, "f8"));
  for (const char* name : {"tip_mm", "tip_direction"}) fields.append(nb::make_tuple(name, "f8", 3));
  fields.append(nb::make_tuple("branch", "i8"));
  fields.append(nb::make_tuple("arc_length_mm", "f8"));
  fields.append(nb::make_tuple("contacts", "i8"));
  for (const char* name : {"contact_force_N", "deepest_mm"}) fields.append(nb::make_tuple(name, "f8"));
  fields.append(nb::make_tuple("tip_scan_mm", "f8", 3));
  for (const char* name : {"wall_work_J", "pressure_mmHg", "aortic_mmHg"})
    fields.append(nb::make_tuple(name, "f8"));
  return record_array(all, fields).attr("reshape")(records.size(), records.front().size());
}

}  // namespace xraycast::python
