#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mechanics/catheter.hpp"
#include "xraycast/simulation/script.hpp"

#include <functional>
#include <string>
#include <vector>

namespace xraycast {

/// What is written down at a row of a script.
struct RunRecord {
  double time_s = 0;
  HubPose pose;
  HubLoad load;
  CatheterTip tip;
  int contacts = 0;            ///< nodes that touch a wall
  double contact_force_N = 0;  ///< the sum of their forces' sizes
  double deepest_mm = 0;       ///< in the wall
};

/// The state of a catheter as a record.
RunRecord record_of(const Catheter& catheter, double time_s);

/// Moves a catheter as a script says, as fast as the machine can, and records it at each row. Beforehand the
/// hub is brought to the first row's pose, unrecorded. The same records, bit for bit, on one machine. Throws
/// InputError, with `name` in front, for an insertion beyond the device's length, Cancelled. `after_step`
/// sees the catheter after each step, and the script's time.
std::vector<RunRecord> run_script(
    Catheter& catheter, const Script& script, const std::string& name, Progress& progress,
    const std::function<void(const Catheter& catheter, double time_s)>& after_step = {});

/// CSV: the names of the columns, with their units, then a line a record.
std::string to_csv(const std::vector<RunRecord>& records);

}  // namespace xraycast
