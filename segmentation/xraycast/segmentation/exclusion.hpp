#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"
#include "xraycast/segmentation/threshold.hpp"

namespace xraycast {

/// What shines like a vessel and is none, as a mask to be taken off: dense bone with its rim, in which bone
/// and tissue mix to a vessel's CT numbers, and the marrow it encloses within a slice. Metal (above 2000 HU)
/// and what is dense within 5 mm of it, where it blooms, is no bone: a stent stays in its vessel. Nor are
/// small dense spots, such as calcified plaques (less than 100 mm3).
///
/// `vessels` are the voxels that may be vessel: holes in bone that hold mostly them, such as the canals of
/// vertebral and carotid arteries, are left alone. Morphology is OpenCV's, slice by slice. A stage of
/// `progress`.
Mask find_bone(const Volume& volume, const HuWindow& window, const Mask& vessels, Progress& progress);

/// What lies within a disc of that radius around a mask's voxels in a slice, or as far above or below.
Mask dilated(const Mask& mask, double radius_mm);

/// Takes parts off a mask that bone encloses: marrow has the CT numbers of contrast medium, but more than
/// half of its surface lies on bone, of which a vessel only passes through canals.
void drop_marrow(Mask& mask, const Mask& bone);

/// Gives a vessel back the outermost voxels of its lumen that went with bone beside it: what is `bright` and
/// shares a face with it.
void add_rim(const Mask& bright, Mask& vessels);

/// Adds what is denser than a vessel and lies within 1.5 mm of one, but is no bone: plaques in its wall, and
/// a stent's struts and their blooming.
void add_dense_wall(const Volume& volume, const HuWindow& window, const Mask& bone, Mask& vessels);

/// Fills what a vessel's mask encloses within a slice up to `area_mm2`: struts of stents, plaques, streaks.
void fill_holes(Mask& mask, double area_mm2);

}  // namespace xraycast
