#pragma once

#include "xraycast/mask/mask.hpp"

#include <vector>

namespace xraycast {

/// Tracks thin vessels in noise beyond their free ends, where ridge strength falls off because one of its two
/// arms lies past the end. The end's position and direction limit the search. Straight segments of up to 12
/// voxels continue an end within 30 degrees of its direction. The gain of each is the sum of `contrast`
/// (contrast_to_noise) minus two per voxel; the best segment is added up to its largest gain if that is 2.2
/// or more, and tracking continues from its end. In noise alone one end in fifty is continued.
///
/// Returns the segments, a voxel thick, without `vessels`.
Mask track_ridges(const std::vector<float>& contrast, const Mask& vessels);

}  // namespace xraycast
