#pragma once

#include "xraycast/registration/attenuation_pyramid.hpp"
#include "xraycast/registration/rigid_motion.hpp"

#include <cstddef>
#include <vector>

namespace xraycast {

struct PoseCandidate {
  RigidMotion motion;
  double similarity = 0;
};

/// The best, at most `most`, without those that take the scan's corners less than `apart_mm` away from where
/// a better one does, in the mean. Best first.
std::vector<PoseCandidate> distinct(std::vector<PoseCandidate> candidates, double apart_mm, std::size_t most,
                                    const AttenuationPyramid& scan);

}  // namespace xraycast
