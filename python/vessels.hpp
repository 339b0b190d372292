#pragma once

#include "scene.hpp"
#include "xraycast/geometry/mesh.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mask/mask.hpp"

#include <memory>
#include <nanobind/nanobind.h>
#include <optional>
#include <vector>

namespace xraycast::python {

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

/// The shapes of a Catheter or of CoaxialDevices now; none for another object.
std::optional<std::vector<DeviceShape>> steered_shapes(nb::handle devices);

void add_vessels(nb::module_& module);
void add_catheter(nb::module_& module);

}  // namespace xraycast::python
