#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/evidence/lumen_fill.hpp"
#include "xraycast/mask/mask.hpp"

#include <functional>
#include <optional>
#include <utility>
#include <vector>

namespace xraycast {

/// What fills a place of the edited lumen: lumen, nothing, or what was at another place.
struct LumenSource {
  enum class Kind { same, full, empty, other } kind = Kind::same;
  glm::dvec3 from_mm{0, 0, 0};  ///< of other
  /// Of a place that stays the same: so far around it all does; of any other how far it is out of the new
  /// lumen. 0 where that is not known.
  double out_mm = 0;
};
using AskSource = std::function<LumenSource(const glm::dvec3& point_mm)>;

/// A mask and how full its voxels are, changed together.
struct VoxelLumen {
  Mask mask;
  LumenFill fill;
};

/// A box in mm.
using BoxMm = std::pair<glm::dvec3, glm::dvec3>;

/// The blocks of a box's voxels, without those that stay as they are: most, about thin vessels.
std::vector<Box> changing_blocks(const VolumeGeometry& grid, const Box& box, const AskSource& source);

/// Fills the voxels of a box anew: each from 64 places in it. Voxels whose places all stay as they are do,
/// bit for bit.
void change_lumen(VoxelLumen& lumen, const BoxMm& box_mm, const AskSource& source, Progress& progress);

}  // namespace xraycast
