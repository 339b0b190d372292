#pragma once

#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/volume/volume.hpp"

#include <glm/vec3.hpp>

#include <vector>

namespace xraycast {

/// A place that may lie in a vessel.
struct Candidate {
  glm::dvec3 point_mm;
  double hu;  ///< median around it
};

/// Up to three places for seeds in a scan in which no contrast peak shows, the brightest first, in vessels of
/// their own: where the mean within some 3 mm is brighter than soft tissue and darker than dense bone, away
/// from bone, inside the body, and what is connected by lumen of the same brightness is slender. Where
/// nothing is slender, as in a scan of few slices, the brightest places of other shapes. Throws DeviceError.
std::vector<Candidate> brightest_candidates(const Volume& volume, ComputeDevice& device);

}  // namespace xraycast
