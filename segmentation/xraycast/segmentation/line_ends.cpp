#include "xraycast/segmentation/line_ends.hpp"

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

/// Where a line ends, and where to; voxels.
struct LineEnd {
  glm::dvec3 at, along;
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
  const glm::dvec3 helper = std::abs(axis.z) < 0.8 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
  const glm::dvec3 u = glm::normalize(glm::cross(axis, helper)), v = glm::cross(axis, u);
  std::vector<glm::dvec3> directions{axis};
  for (int ring = 1; ring <= 3; ++ring)
    for (int k = 0; k < 6 * ring; ++k) {
      const double tilt = glm::radians(10.0 * ring), turn = k * std::numbers::pi / (3 * ring);
      directions.push_back(std::cos(tilt) * axis +
                           std::sin(tilt) * (std::cos(turn) * u + std::sin(turn) * v));
    }
  return directions;
}

struct Way {
  double worth = 0;
  glm::dvec3 along{0, 0, 0};
  int steps = 0;
};

class Follower {
 public:
  Follower(const std::vector<float>& rise, const Mask& vessels)
      : rise_(rise), taken_(vessels), ways_(vessels.geometry) {}

  Mask run(std::vector<LineEnd> ends, Progress& progress) {
    constexpr double kMinWorth = 2.2;
    while (!ends.empty()) {
      progress.check();
      const LineEnd end = ends.back();
      ends.pop_back();
      const Way way = best_way(end);
      if (way.worth < kMinWorth) continue;
      bool is_new = false;
      for (int k = 1; k <= way.steps; ++k) {
        const Index3 voxel(glm::round(end.at + static_cast<double>(k) * way.along));
        if (taken_.at(voxel)) continue;
        ways_[voxel] = taken_[voxel] = 1;
        is_new = true;
      }
      // What leads along a vessel that is known ends here: a ring has no end.
      if (!is_new) continue;
      ends.push_back({end.at + static_cast<double>(way.steps) * way.along, way.along});
    }
    return std::move(ways_);
  }

 private:
  /// A way that leads into a vessel ends there; its first two voxels may lie in its own.
  Way best_way(const LineEnd& end) const {
    constexpr int kMaxSteps = 12, kOwnSteps = 2;
    constexpr double kMinRise = 2;
    Way best;
    for (const glm::dvec3& along : cone_around(end.along)) {
      double worth = 0;
      for (int k = 1; k <= kMaxSteps; ++k) {
        const glm::dvec3 p = end.at + static_cast<double>(k) * along;
        const std::optional<double> rise = rise_at(p);
        if (!rise || (k > kOwnSteps && taken_.at(Index3(glm::round(p))))) break;
        worth += *rise - kMinRise;
        if (worth > best.worth) best = {worth, along, k};
      }
    }
    return best;
  }

  /// Between voxels; nothing beyond the outermost ones.
  std::optional<double> rise_at(const glm::dvec3& p) const {
    const Index3 low(glm::floor(p));
    if (!taken_.contains(low) || !taken_.contains(low + Index3(1))) return std::nullopt;
    return trilinear(taken_, rise_, low, p - glm::dvec3(low));
  }

  const std::vector<float>& rise_;
  Mask taken_, ways_;
};

}  // namespace

Mask ways_beyond_ends(const std::vector<float>& rise, const Mask& vessels, Progress& progress) {
  return Follower(rise, vessels).run(free_ends(thin(vessels)), progress);
}

}  // namespace xraycast
