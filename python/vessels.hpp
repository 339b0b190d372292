#pragma once

#include "xraycast/geometry/mesh.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mask/mask.hpp"

#include <memory>
#include <nanobind/nanobind.h>

namespace xraycast::python {

namespace nb = nanobind;

/// A vessel tree, which what was made from it shares.
struct HeldTree {
  std::shared_ptr<const VesselTree> tree;
};

struct HeldMesh {
  std::shared_ptr<const Mesh> mesh;
};

struct HeldVessels {
  std::shared_ptr<const Mask> mask;
  HeldTree tree;
  HeldMesh surface;
};

void add_vessels(nb::module_& module);
void add_catheter(nb::module_& module);

}  // namespace xraycast::python
