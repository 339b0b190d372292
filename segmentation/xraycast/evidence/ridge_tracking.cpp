#include "xraycast/evidence/ridge_tracking.hpp"

#include "xraycast/evidence/axes_across.hpp"
#include "xraycast/mask/thinning.hpp"
#include "xraycast/mask/trilinear.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

namespace xraycast {
namespace {

/// A free end of a line and the direction in which it points; voxels.
struct LineEnd {
  glm::dvec3 at, direction;
};

/// The free ends of lines one voxel wide; their direction is that of the last six voxels.
std::vector<LineEnd> free_ends(const Mask& lines) {
  constexpr int kLast = 6;
  std::vector<LineEnd> ends;
  for (std::size_t i = 0; i < lines.voxels.size(); ++i) {
    if (lines.voxels[i] == 0) continue;
    const Index3 end = voxel_at(lines.geometry, static_cast<std::int64_t>(i));
    std::vector<Index3> next = neighbours_in(lines, end);
    if (next.size() != 1) continue;
    Index3 before = end, here = next[0];
    for (int k = 2; k < kLast && (next = neighbours_in(lines, here)).size() == 2; ++k) {
      const Index3 onwards = next[next[0] == before ? 1 : 0];
      before = here;
      here = onwards;
    }
    ends.push_back({glm::dvec3(end), glm::normalize(glm::dvec3(end - here))});
  }
  return ends;
}

/// Directions ten degrees apart, up to thirty from an axis.
std::vector<glm::dvec3> cone_around(const glm::dvec3& axis) {
  const auto [u, v] = axes_across(axis);
  std::vector<glm::dvec3> directions{axis};
  for (int ring = 1; ring <= 3; ++ring)
    for (int k = 0; k < 6 * ring; ++k) {
      const double tilt = glm::radians(10.0 * ring), turn = k * std::numbers::pi / (3 * ring);
      directions.push_back(std::cos(tilt) * axis +
                           std::sin(tilt) * (std::cos(turn) * u + std::sin(turn) * v));
    }
  return directions;
}

/// A straight segment that continues a line.
struct Segment {
  double gain = 0;
  glm::dvec3 direction{0, 0, 0};
  int steps = 0;
};

class RidgeTracker {
 public:
  RidgeTracker(const std::vector<float>& contrast, const Mask& vessels)
      : contrast_(contrast), vessels_(vessels), tracked_(vessels.geometry) {}

  Mask run(std::vector<LineEnd> ends) {
    constexpr double kMinGain = 2.2;
    while (!ends.empty()) {
      check_cancelled();
      const LineEnd end = ends.back();
      ends.pop_back();
      const Segment segment = best_segment(end);
      if (segment.gain < kMinGain) continue;
      bool is_new = false;
      for (int k = 1; k <= segment.steps; ++k) {
        const Index3 voxel(glm::round(end.at + static_cast<double>(k) * segment.direction));
        if (vessels_.at(voxel)) continue;
        tracked_[voxel] = vessels_[voxel] = 1;
        is_new = true;
      }
      // A segment along a vessel that is known is not tracked further: a ring has no end.
      if (!is_new) continue;
      ends.push_back({end.at + static_cast<double>(segment.steps) * segment.direction, segment.direction});
    }
    return std::move(tracked_);
  }

 private:
  /// A segment that runs into a vessel ends there; its first two voxels may lie in its own.
  Segment best_segment(const LineEnd& end) const {
    constexpr int kMaxSteps = 12, kOwnSteps = 2;
    constexpr double kMinContrast = 2;
    Segment best;
    for (const glm::dvec3& direction : cone_around(end.direction)) {
      double gain = 0;
      for (int k = 1; k <= kMaxSteps; ++k) {
        const glm::dvec3 p = end.at + static_cast<double>(k) * direction;
        const std::optional<double> contrast = contrast_at(p);
        if (!contrast || (k > kOwnSteps && vessels_.at(Index3(glm::round(p))))) break;
        gain += *contrast - kMinContrast;
        if (gain > best.gain) best = {gain, direction, k};
      }
    }
    return best;
  }

  /// Trilinear; nothing beyond the outermost voxels.
  std::optional<double> contrast_at(const glm::dvec3& p) const {
    const Index3 low(glm::floor(p));
    if (!vessels_.contains(low) || !vessels_.contains(low + Index3(1))) return std::nullopt;
    return trilinear(vessels_, contrast_, low, p - glm::dvec3(low));
  }

  const std::vector<float>& contrast_;
  Mask vessels_;  ///< with what was tracked
  Mask tracked_;
};

}  // namespace

Mask track_ridges(const std::vector<float>& contrast, const Mask& vessels) {
  return RidgeTracker(contrast, vessels).run(free_ends(thin(vessels)));
}

}  // namespace xraycast
