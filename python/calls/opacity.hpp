#pragma once

#include "xraycast/attenuation/spectrum.hpp"

#include <filesystem>
#include <nanobind/nanobind.h>
#include <variant>

namespace xraycast::python {

namespace nb = nanobind;

/// An Opacity, or the name or file of one, or `spectrum:KVP`.
using OpacityArgument = std::variant<Opacity, std::filesystem::path>;

/// Throws InputError.
Attenuation attenuation_of(const OpacityArgument& opacity);

/// The same without spectra, for what `call` makes.
Opacity opacity_of(const OpacityArgument& opacity, const char* call);

void add_opacity(nb::module_& module);

}  // namespace xraycast::python
