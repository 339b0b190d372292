#pragma once

#include <nanobind/nanobind.h>

namespace xraycast::python {

/// What xraycast.similarity holds.
void add_similarities(nanobind::module_& module);

}  // namespace xraycast::python
