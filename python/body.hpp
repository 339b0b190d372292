#pragma once

#include "xraycast/casting/body_map.hpp"

#include <memory>
#include <nanobind/nanobind.h>

namespace xraycast::python {

namespace nb = nanobind;

struct HeldBody {
  std::shared_ptr<const BodyMap> map;
};

/// Pages and glTF scenes of what is held.
void add_export(nb::module_& module);

}  // namespace xraycast::python
