#pragma once

#include "calls/values.hpp"
#include "xraycast/simulation/run.hpp"

#include <nanobind/nanobind.h>
#include <vector>

namespace xraycast::python {

/// A structured array (records, instruments).
nb::object records_array(const std::vector<std::vector<RunRecord>>& records);

}  // namespace xraycast::python
