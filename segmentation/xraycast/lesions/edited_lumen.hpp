#pragma once

#include "xraycast/evidence/lumen_fill.hpp"
#include "xraycast/mask/mask.hpp"

#include <functional>
#include <optional>
#include <utility>

namespace xraycast {

/// What fills a place of the edited lumen: lumen, nothing, or what was at another place.
struct LumenSource {
  enum class Kind { same, full, empty, other } kind = Kind::same;
  glm::dvec3 from_mm{0, 0, 0};  ///< of other
  double out_mm = 0;            ///< how far the place is out of all that changes, where that is known
};

/// A mask and how full its voxels are, changed together.
struct VoxelLumen {
  Mask mask;
  LumenFill fill;
};

/// A box in mm.
using BoxMm = std::pair<glm::dvec3, glm::dvec3>;

/// Fills the voxels of a box anew: each from 64 places in it. Voxels whose places all stay as they are do,
/// bit for bit.
void change_lumen(VoxelLumen& lumen, const BoxMm& box_mm,
                  const std::function<LumenSource(const glm::dvec3& point_mm)>& source);

}  // namespace xraycast
