#pragma once

#include "xraycast/blood_flow/blood.hpp"

#include <nanobind/nanobind.h>

namespace xraycast::python {

/// The blood of a body whose heart beats so often a minute, or ejects by a waveform: a file, or an array
/// (samples, 2) of times in s and flows in ml/s. None of both: as Blood. Throws InputError for both.
Blood blood_of(const nanobind::object& heart_rate_bpm, const nanobind::object& heart_waveform);

}  // namespace xraycast::python
