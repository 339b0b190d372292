#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"

namespace xraycast {

/// The parts of a mask with the CT numbers of contrast agent and the shape of trabecular bone, up to 5 mm
/// thick:
/// - plates, such as the diploe between the two tables of the skull, the shells of ribs and sternum, and
///   septa: they extend in two dimensions, where so thin a vessel extends along one line only. A ball of four
///   times the radius holds more than 1.75 times what it would hold of a straight tube, which leaves room for
///   a bifurcation;
/// - parts surrounded by dense `bone`: 65 % of their surroundings within two and a half voxels.
///
/// A vessel in a bony canal is removed as well; close_gaps restores it. Voxels within the sphere inscribed in
/// a thicker structure are kept. Four units of `progress`.
Mask find_trabecular_bone(const Mask& mask, const Mask& bone, Progress& progress);
inline Mask find_trabecular_bone(const Mask& mask, const Mask& bone) {
  Progress unheard;
  return find_trabecular_bone(mask, bone, unheard);
}

}  // namespace xraycast
