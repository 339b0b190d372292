#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"
#include "xraycast/segmentation/threshold.hpp"

namespace xraycast {

/// Bone, whose voxels would be false positives, as a mask: dense bone with its rim, where the partial volume
/// of bone and soft tissue has a vessel's CT numbers, and the marrow that it encloses within a slice. Metal
/// (above 2000 HU) and dense voxels within 5 mm of it (blooming) do not count as bone, so that a stent stays
/// in its vessel; nor do small dense components, such as calcified plaques (less than 100 mm3).
///
/// `vessels` are the voxels that may be vessel: holes in bone that consist mostly of them, such as the canals
/// of vertebral and carotid arteries, are not filled. Morphology is OpenCV's, slice by slice. A stage of
/// `progress`.
Mask find_bone(const Volume& volume, const HuWindow& window, const Mask& vessels, Progress& progress);

/// Removes the components of a mask that bone encloses: marrow has the CT numbers of contrast agent, but more
/// than half of its surface touches bone, which a vessel touches only in canals.
void remove_marrow(Mask& mask, const Mask& bone);

}  // namespace xraycast
