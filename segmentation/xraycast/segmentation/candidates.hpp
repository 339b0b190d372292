#pragma once

#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/volume/volume.hpp"

#include <glm/vec3.hpp>

#include <vector>

namespace xraycast {

/// A place that may lie in a vessel.
struct Candidate {
  glm::dvec3 point_mm;
  double hu;  ///< mean around it
};

/// Up to four places for seeds in a scan in which no contrast peak shows, the brightest first, 40 mm or more
/// apart: where the mean within some 3 mm is brighter than soft tissue and darker than dense bone, farther
/// than 3 mm from bone, inside the body. Throws DeviceError.
std::vector<Candidate> brightest_candidates(const Volume& volume, ComputeDevice& device);

}  // namespace xraycast
