#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"

#include <vector>

namespace xraycast {

/// Tracks thin vessels in noise beyond their free ends, where ridge strength falls off: the weaker of its two
/// arms lies past a vessel's end, but an end is known, and with it where to look. Straight segments of up to
/// 12 voxels continue an end within 30 degrees of its direction. The gain of each is the sum of `contrast`
/// (contrast_to_noise) less two a voxel; the best segment is added, as far as it gains, where its gain is 2.2
/// or more, and tracking goes on from its end. In noise alone one end in fifty is continued.
///
/// Returns the segments, a voxel thick, without `vessels`.
Mask track_ridges(const std::vector<float>& contrast, const Mask& vessels, Progress& progress);

}  // namespace xraycast
