#pragma once

#include "xraycast/registration/rigid_motion.hpp"
#include "xraycast/volume/volume.hpp"

#include <string>

namespace xraycast {

/// A camera that looks at the origin, at the middle of the scan instead.
PinholeCamera looking_at(PinholeCamera camera, const VolumeGeometry& scan);

/// A start pose: `30,10`, the C-arm's angles LAO and cranial in degrees, from which the camera sees the
/// scan's middle where it does now; or a JSON file with a `motion`, 3 x 4 or 4 x 4, of the scan in front of
/// the cameras. Throws InputError.
RigidMotion read_start(const std::string& text, const PinholeCamera& camera, const VolumeGeometry& scan);

}  // namespace xraycast
