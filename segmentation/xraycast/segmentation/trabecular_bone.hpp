#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"

namespace xraycast {

/// The parts of a mask that have the CT numbers of contrast medium and the shape of trabecular bone, as far
/// as they are up to 5 mm thick:
/// - plates, such as the diploe between the two tables of the skull, the shells of ribs and sternum, and
///   septa: they reach far to all sides, where a vessel so thin does so along one line only. A ball of four
///   times the radius holds more than 1.75 times what it would hold of a straight tube, which leaves room for
///   a bifurcation;
/// - what mostly dense `bone` surrounds: 65 % of all that lies around it, within two and a half voxels.
///
/// A vessel in a bony canal is removed as well; close_gaps brings it back. What lies within the sphere
/// inscribed in something thicker stays. Four units of `progress`.
Mask find_trabecular_bone(const Mask& mask, const Mask& bone, Progress& progress);
inline Mask find_trabecular_bone(const Mask& mask, const Mask& bone) {
  Progress unheard;
  return find_trabecular_bone(mask, bone, unheard);
}

}  // namespace xraycast
