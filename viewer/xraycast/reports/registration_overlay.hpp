#pragma once

#include "xraycast/base/picture_file.hpp"
#include "xraycast/opencl/resident_scan.hpp"
#include "xraycast/registration/registration.hpp"

#include <span>

namespace xraycast {

/// How well a registered pose fits, for the eye: a row for each X-ray, with the X-ray, the projection from
/// the pose, the projection's edges in red on the X-ray, and both in a checkerboard. Up to 600 pixels each.
/// Throws DeviceError when the device fails.
RgbPicture registration_overlay(std::span<const Xray> xrays, const Registration& pose,
                                const ResidentScan& scan, const Opacity& opacity, Progress& progress);

}  // namespace xraycast
