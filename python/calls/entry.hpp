#pragma once

#include "xraycast/catheter/vessel_entry.hpp"

#include <nanobind/nanobind.h>

namespace xraycast::python {

/// Of None, a branch's number, a vessel's name, or a point near a vessel's end.
EntryChoice entry_choice(const nanobind::object& entry);

}  // namespace xraycast::python
