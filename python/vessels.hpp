#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <memory>
#include <nanobind/nanobind.h>

namespace xraycast::python {

namespace nb = nanobind;

/// A vessel tree, which what was made from it shares.
struct HeldTree {
  std::shared_ptr<const VesselTree> tree;
};

void add_vessels(nb::module_& module);
void add_catheter(nb::module_& module);

}  // namespace xraycast::python
