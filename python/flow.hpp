#pragma once

#include <nanobind/nanobind.h>

namespace xraycast::python {

namespace nb = nanobind;

void add_flow(nb::module_& module);

}  // namespace xraycast::python
