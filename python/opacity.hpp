#pragma once

#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/attenuation/spectrum.hpp"

#include <nanobind/nanobind.h>
#include <variant>

namespace xraycast::python {

namespace nb = nanobind;

using Attenuation = std::variant<Opacity, Spectrum>;

/// An Opacity, or the name or file of one, or `spectrum:KVP`. Throws InputError.
Attenuation attenuation_of(const nb::object& opacity);

/// The same without spectra, for what `call` makes.
Opacity opacity_of(const nb::object& opacity, const char* call);

void add_opacity(nb::module_& module);

}  // namespace xraycast::python
