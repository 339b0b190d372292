#pragma once

#include <glm/vec3.hpp>

#include <filesystem>
#include <vector>

namespace xraycast {

/// One thing in two scans, mm, LPS.
struct LandmarkPair {
  glm::dvec3 reference_mm, phase_mm;
};

/// Reads a CSV with a row for each pair: the phase's number in the order of the scans, from 1; x, y and z in
/// the reference, and in the phase, in mm, LPS. A first row of words is skipped. Returns the pairs of each
/// phase. Throws InputError, naming file and line.
std::vector<std::vector<LandmarkPair>> read_landmark_pairs(const std::filesystem::path& path,
                                                           std::size_t phases);

}  // namespace xraycast
