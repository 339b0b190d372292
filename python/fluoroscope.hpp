#pragma once

#include "xraycast/acquisition/acquisition.hpp"
#include "xraycast/fluoroscope/fluoroscope_request.hpp"

#include <nanobind/nanobind.h>
#include <optional>

namespace xraycast::python {

namespace nb = nanobind;

/// A fluoroscope as it was asked for, and what that means.
struct HeldFluoroscope {
  FluoroscopeRequest request;
  FluoroscopyOptions options;
};

/// None for None. Throws InputError for what is no Fluoroscope.
std::optional<HeldFluoroscope> fluoroscope_of(const nb::object& object);

/// Fluoroscope, and Exposure, which frames have.
void add_fluoroscope(nb::module_& module);

}  // namespace xraycast::python
