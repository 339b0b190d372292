#pragma once

#include "xraycast/projection/pinhole_camera.hpp"
#include "xraycast/registration/rigid_motion.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace xraycast {

/// Reads the cameras of a file: JSON with `K` (3 x 3, pixels) and `RT` (3 x 4 or 4 x 4, the scan's mm or a
/// rig's to the camera's), or with `poses`, a list of such; YAML or XML of OpenCV's FileStorage with
/// `camera_matrix` or `K`, and `RT`, or a rotation (`R`, `rvec`) and a translation (`T`, `tvec`), without
/// distortion; or a camera of Autoscoper (text, with the lines `camera matrix`, `rotation` and
/// `translation`). The size is 0 where the file does not state it. Rotations that are rounded are made exact.
/// Throws InputError, naming file and field.
std::vector<PinholeCamera> read_cameras(const std::filesystem::path& path);

/// The `motion` of a JSON file, 3 x 4 or 4 x 4, or of the first of its `poses`. Throws InputError.
RigidMotion read_motion_matrix(const std::filesystem::path& path);

}  // namespace xraycast
