#pragma once

#include "xraycast/geometry/mesh.hpp"
#include "xraycast/mask/mask.hpp"

#include <memory>

namespace xraycast {

/// The fraction of each voxel inside a mask, smoothed by a Gaussian of 1.6 voxels, but where the mask is
/// thin, of 0.8, as the other one would leave nothing of a vessel two voxels wide.
class SmoothedMask {
 public:
  virtual ~SmoothedMask() = default;

  /// The closed surface where that fraction is `1 - level`: the higher the level, the larger.
  virtual Mesh isosurface(double level) const = 0;
};

/// `thin`: what is thin of the mask, on the same grid. By OpenVDB, whose library takes longer to load than
/// all others together, so the first call loads it, not the start of the program. Throws Error when it is not
/// installed beside the program.
std::unique_ptr<SmoothedMask> smoothed_mask(const Mask& mask, const Mask& thin);

}  // namespace xraycast
