#pragma once

#include "xraycast/device.hpp"
#include "xraycast/mask.hpp"
#include "xraycast/progress.hpp"
#include "xraycast/volume.hpp"

namespace xraycast {

/// Follows thin vessels in noise beyond their free ends, where line strength leaves them: of two arms the
/// weaker lies past a vessel's end, but an end is known, and with it where to look. Straight ways of up to
/// 12 voxels go on from an end within 30 degrees of its direction. Each is worth how bright it is, less its
/// neighbourhood, in standard deviations of the background, and less two a voxel; the best one is taken,
/// as far as it gains, where it is worth 2.2, and followed on from its own end. In noise alone one end in
/// fifty goes on.
///
/// Returns the ways, a voxel thick, without `vessels`. Throws DeviceError.
Mask ways_beyond_ends(const Volume& volume, const Mask& vessels, Device& device, Progress& progress);

}  // namespace xraycast
