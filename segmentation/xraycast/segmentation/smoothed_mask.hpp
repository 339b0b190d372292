#pragma once

#include "xraycast/geometry/mesh.hpp"
#include "xraycast/mask/mask.hpp"

#include <memory>

namespace xraycast {

/// The fraction of each voxel inside a mask, smoothed by a Gaussian of half a voxel.
class SmoothedMask {
 public:
  virtual ~SmoothedMask() = default;

  /// The closed surface where that fraction is `1 - level`: the higher the level, the larger.
  virtual Mesh isosurface(double level) const = 0;
};

/// By OpenVDB, whose library takes longer to load than all others together, so the first call loads it, not
/// the start of the program. Throws Error when it is not installed beside the program.
std::unique_ptr<SmoothedMask> smoothed_mask(const Mask& mask);

}  // namespace xraycast
