#pragma once

#include "xraycast/geometry/mesh.hpp"
#include "xraycast/mask/mask.hpp"

#include <memory>

namespace xraycast {

/// How much of each voxel is inside a mask, smoothed with a Gaussian of half a voxel.
class LevelSet {
 public:
  virtual ~LevelSet() = default;

  /// The closed surface where that share is `1 - level`: the higher the level, the larger.
  virtual Mesh mesh_at(double level) const = 0;
};

/// By OpenVDB, whose library takes longer to load than all others together. It is loaded by the first call
/// and not when the program starts. Throws Error when it is not where the program was installed.
std::unique_ptr<LevelSet> level_set_of(const Mask& mask);

}  // namespace xraycast
