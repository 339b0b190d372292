#pragma once

#include "scene.hpp"
#include "xraycast/geometry/mesh.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mask/mask.hpp"
#include "xraycast/segmentation/vessels.hpp"
#include "xraycast/volume/scan_info.hpp"

#include <memory>
#include <nanobind/nanobind.h>
#include <optional>
#include <string>
#include <vector>

namespace xraycast::python {

/// A vessel tree, which what was made from it shares.
struct HeldTree {
  std::shared_ptr<const VesselTree> tree;
};

struct HeldMesh {
  std::shared_ptr<const Mesh> mesh;
};

/// Vessels, and of what and how: for files.
struct HeldVessels {
  std::shared_ptr<const Vessels> found;
  ScanInfo scan;
  SegmentRequest request;
  std::string origin = {};  ///< of vessels that were given; empty where they were found in a scan

  /// A part that keeps the whole alive.
  template <typename Part>
  std::shared_ptr<const Part> part(const Part& of_found) const {
    return {found, &of_found};
  }
  std::shared_ptr<const Mask> mask() const { return part(found->mask); }
};

/// The shapes of a Catheter or of CoaxialInstruments now; none for another object.
std::optional<std::vector<InstrumentShape>> steered_shapes(nb::handle instruments);

void add_vessels(nb::module_& module);
void add_catheter(nb::module_& module);
void add_edit(nb::module_& module);

}  // namespace xraycast::python
