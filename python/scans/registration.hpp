#pragma once

#include <nanobind/nanobind.h>

namespace xraycast::python {

/// register, and what it returns.
void add_registration(nanobind::module_& module);

}  // namespace xraycast::python
