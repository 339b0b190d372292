#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"

#include <vector>

namespace xraycast {

/// Follows thin vessels in noise beyond their free ends, where line strength leaves them: of two arms the
/// weaker lies past a vessel's end, but an end is known, and with it where to look. Straight ways of up to
/// 12 voxels go on from an end within 30 degrees of its direction. Each is worth how far it rises
/// (local_rise) less two a voxel; the best one is taken, as far as it gains, where it is worth 2.2, and
/// followed on from its own end. In noise alone one end in fifty goes on.
///
/// Returns the ways, a voxel thick, without `vessels`.
Mask ways_beyond_ends(const std::vector<float>& rise, const Mask& vessels, Progress& progress);

}  // namespace xraycast
