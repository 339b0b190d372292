#pragma once

#include "calls/values.hpp"
#include "xraycast/simulation/run.hpp"
#include "xraycast/simulation/run_monitor.hpp"

#include <nanobind/nanobind.h>
#include <optional>
#include <string>

namespace xraycast::python {

/// The exercise of a file in a request's tree, or none of None; its entry is the request's where that is
/// None. Throws InputError, also for instruments that it does not allow.
std::optional<Exercise> take_exercise(RunRequest& request, const nb::object& entry,
                                      const nb::object& exercise);

/// What VesselTree.exercise gives: the exercise as a dict, with the place of each target.
nb::dict exercise_object(const Exercise& exercise, const VesselTree& tree);

/// RunMonitor's JSON as a dict.
nb::dict report_object(const std::string& json);

}  // namespace xraycast::python
