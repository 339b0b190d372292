#pragma once

#include "xraycast/mask.hpp"
#include "xraycast/threshold.hpp"

namespace xraycast {

/// What shines like a vessel and is none, as a mask to be taken off: dense bone with its rim, in which bone
/// and tissue mix to a vessel's CT numbers, and the marrow it encloses within a slice. Metal (above 2000 HU)
/// and what is dense within 5 mm of it, where it blooms, is no bone: a stent stays in its vessel. Nor are
/// small dense spots, such as calcified plaques (less than 100 mm3).
///
/// `vessels` are the voxels that may be vessel: holes in bone that hold mostly them, such as the canals of
/// vertebral and carotid arteries, are left alone. Morphology is OpenCV's, slice by slice.
Mask find_bone(const Volume& volume, const HuWindow& window, const Mask& vessels);

/// Fills what a vessel's mask encloses within a slice up to `area_mm2`: struts of stents, plaques, streaks.
void fill_holes(Mask& mask, double area_mm2);

}  // namespace xraycast
