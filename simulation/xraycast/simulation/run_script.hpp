#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/coaxial/instruments.hpp"
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
  InstrumentTip tip;
  int contacts = 0;            ///< contact points in contact with a wall
  double contact_force_N = 0;  ///< sum of the magnitudes of their forces
  double deepest_mm = 0;       ///< depth in the wall
};

/// A record of each device, from the outermost on.
std::vector<RunRecord> records_of(const Instruments& devices, double time_s);

/// Runs a script on coaxial devices, or on one alone, as fast as the machine can, and records each device at
/// each row. Beforehand the hubs are moved to the first row's poses, unrecorded. Deterministic: bit for bit
/// the same on one machine. Throws InputError, with `name` in front, for an insertion beyond an instrument's
/// length and for a first row that a device does not reach, and Cancelled. `after_step` is called after each
/// step with the devices and the script's time.
std::vector<std::vector<RunRecord>> run_script(
    Instruments& devices, const Script& script, const std::string& name, Progress& progress,
    const std::function<void(const Instruments& devices, double time_s)>& after_step = {});

/// CSV: a header with the columns' names and units, then a line per row of the script; a group of columns a
/// device: insertion_mm, insertion_2_mm and so on.
std::string to_csv(const std::vector<std::vector<RunRecord>>& records);

}  // namespace xraycast
