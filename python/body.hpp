#pragma once

#include "xraycast/casting/body_map.hpp"

#include <memory>
#include <nanobind/nanobind.h>
#include <string>
#include <vector>

namespace xraycast::python {

namespace nb = nanobind;

struct HeldBasis;

struct HeldBody {
  std::shared_ptr<const BodyMap> map;
  std::shared_ptr<HeldBasis> basis{};
  std::vector<std::string> notes{};
};

/// compare() and Comparison.
void add_compare(nb::module_& module);

/// Pages and glTF scenes of what is held.
void add_export(nb::module_& module);

}  // namespace xraycast::python
