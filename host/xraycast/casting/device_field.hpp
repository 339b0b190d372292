#pragma once

#include "xraycast/kernels/params.h"
#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/volume/volume.hpp"

#include <glm/vec3.hpp>

#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// The grid on which a scan's displacements are kept while rays pass through it: trilinear between nodes,
/// which enclose all voxels.
struct FieldNodes {
  /// About `spacing_mm` apart; along z by a number of slices that divides those of a brick.
  FieldNodes(const VolumeGeometry& scan, double spacing_mm);

  Index3 size{0, 0, 0};
  glm::dvec3 step{1, 1, 1};  ///< voxels; whole slices
  VolumeGeometry scan;

  std::int64_t count() const { return size.x * size.y * size.z; }
  glm::dvec3 place_mm(const Index3& node) const { return scan.to_world_mm(step * glm::dvec3(node)); }
};

/// A displacement of a scan on a device: a place x of the moved scan shows what lies at x + d(x).
class DeviceField {
 public:
  /// `displacement_mm` of each node, x fastest.
  DeviceField(ComputeDevice& device, const FieldNodes& nodes, std::span<const glm::vec3> displacement_mm);

  std::string build_options() const;

  /// The last two arguments of a kernel that was built with these, from number `first` on.
  void set_args(cl::Kernel& kernel, unsigned first) const;

 private:
  XrcField layout_;
  int slices_;  ///< between nodes
  cl::Buffer nodes_;
};

/// The rows of a map that are cast, and the displacement of the scan meanwhile.
struct MovedRows {
  const DeviceField& field;
  int first = 0, count = 0;  ///< of a cylinder: whole bricks, counted from the most inferior slice on
};

}  // namespace xraycast
