#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/coaxial/coaxial_catheters.hpp"
#include "xraycast/mechanics/catheter.hpp"
#include "xraycast/simulation/script.hpp"

#include <functional>
#include <string>
#include <vector>

namespace xraycast {

/// The record logged at a row of a script.
struct RunRecord {
  double time_s = 0;
  HubPose pose;
  HubLoad load;
  CatheterTip tip;
  int contacts = 0;            ///< contact points in contact with a wall
  double contact_force_N = 0;  ///< sum of the magnitudes of their forces
  double deepest_mm = 0;       ///< depth in the wall
};

/// A record of a catheter's state.
RunRecord record_of(const Catheter& catheter, double time_s);

/// Runs a script on a catheter, as fast as the machine can, and records it at each row. Beforehand the hub is
/// moved to the first row's pose, unrecorded. Deterministic: bit for bit the same on one machine. Throws
/// InputError, with `name` in front, for an insertion beyond the instrument's length, and Cancelled.
/// `after_step` is called after each step with the catheter and the script's time.
std::vector<RunRecord> run_script(
    Catheter& catheter, const Script& script, const std::string& name, Progress& progress,
    const std::function<void(const Catheter& catheter, double time_s)>& after_step = {});

/// The same for coaxial devices: a record of each device, from the outermost on, at each row.
std::vector<RunRecord> records_of(const Catheter& catheter, double time_s);  ///< the one
std::vector<RunRecord> records_of(const CoaxialCatheters& devices, double time_s);
std::vector<std::vector<RunRecord>> run_script(
    CoaxialCatheters& devices, const Script& script, const std::string& name, Progress& progress,
    const std::function<void(const CoaxialCatheters& devices, double time_s)>& after_step = {});

/// CSV as below, with a group of columns a device: insertion_2_mm, force_2_N, tip_2_x_mm and so on.
std::string to_csv(const std::vector<std::vector<RunRecord>>& records);

/// CSV: a header with the columns' names and units, then a line per record.
std::string to_csv(const std::vector<RunRecord>& records);

}  // namespace xraycast
