#include "xraycast/registration/pose_candidates.hpp"

#include <glm/geometric.hpp>

#include <algorithm>

namespace xraycast {
namespace {

double distance_mm(const RigidMotion& a, const RigidMotion& b, const AttenuationPyramid& scan) {
  double sum = 0;
  for (const glm::dvec3& corner_mm : corners_of(scan.lower_mm(), scan.upper_mm()))
    sum += glm::distance(a(corner_mm), b(corner_mm));
  return sum / 8;
}

}  // namespace

std::vector<PoseCandidate> distinct(std::vector<PoseCandidate> candidates, double apart_mm, std::size_t most,
                                    const AttenuationPyramid& scan) {
  std::ranges::stable_sort(
      candidates, [](const PoseCandidate& a, const PoseCandidate& b) { return a.similarity > b.similarity; });
  std::vector<PoseCandidate> kept;
  for (const PoseCandidate& one : candidates) {
    if (kept.size() == most) break;
    if (std::ranges::all_of(kept, [&](const PoseCandidate& better) {
          return distance_mm(one.motion, better.motion, scan) > apart_mm;
        }))
      kept.push_back(one);
  }
  return kept;
}

}  // namespace xraycast
