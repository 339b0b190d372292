#include "support/branching_tree.hpp"

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace xraycast {
namespace {

class Growth {
 public:
  explicit Growth(std::uint32_t seed) : random_(seed) {}

  std::vector<VesselBranch> grow() {
    const double radius_mm = uniform(4, 8);
    const VesselPoint start{{uniform(-50, 50), uniform(-50, 50), 700}, radius_mm};
    branches_.push_back(
        branch({start, glm::normalize(glm::dvec3{uniform(-0.4, 0.4), uniform(-0.4, 0.4), -1})}, radius_mm,
               6 * radius_mm, -1));
    for (std::size_t parent = 0; parent < branches_.size() && branches_.size() < 24; ++parent) split(parent);
    return branches_;
  }

 private:
  struct Start {
    VesselPoint point;
    glm::dvec3 direction;
  };

  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(random_()) + 0.5) / 4294967296.0;
  }

  static glm::dvec3 across(const glm::dvec3& direction) {
    return glm::normalize(
        glm::cross(direction, std::abs(direction.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0)));
  }

  glm::dvec3 turned(const glm::dvec3& along, double angle, double around) const {
    const glm::dvec3 side = across(along), other = glm::cross(along, side);
    return std::cos(angle) * along + std::sin(angle) * (std::cos(around) * side + std::sin(around) * other);
  }

  /// A bend of one curvature, which is never sharper than four radii, in steps of half a millimetre; it
  /// tapers by a tenth.
  VesselBranch branch(const Start& start, double radius_mm, double length_mm, int parent) {
    constexpr double kStep_mm = 0.5;
    const double bend = uniform(0, 0.25) / radius_mm * kStep_mm;
    glm::dvec3 direction = start.direction;
    const glm::dvec3 normal = turned(direction, std::numbers::pi / 2, uniform(0, 2 * std::numbers::pi));
    const glm::dvec3 axis = glm::normalize(glm::cross(direction, normal));
    VesselBranch branch;
    branch.parent = parent;
    const int steps = static_cast<int>(std::ceil(length_mm / kStep_mm));
    glm::dvec3 at = start.point.position_mm;
    for (int k = 0; k <= steps; ++k) {
      branch.points.push_back({at, radius_mm * (1 - 0.1 * k / steps)});
      direction = glm::normalize(direction + bend * glm::cross(axis, direction));
      at += kStep_mm * direction;
    }
    return branch;
  }

  /// Whether a branch keeps clear of all others once it has left those that begin or end where it does.
  bool is_clear(const VesselBranch& added, const std::vector<VesselBranch>& siblings) const {
    const auto is_clear_of = [&](const VesselBranch& other, bool is_kin) {
      for (const VesselPoint& a : added.points) {
        const double from_start_mm = glm::distance(a.position_mm, added.points.front().position_mm);
        for (const VesselPoint& b : other.points) {
          const double least_mm = a.radius_mm + b.radius_mm + 1;
          const double needed_mm = is_kin ? std::min(least_mm, 0.5 * from_start_mm) : least_mm;
          if (glm::distance(a.position_mm, b.position_mm) < needed_mm) return false;
        }
      }
      return true;
    };
    for (std::size_t i = 0; i < branches_.size(); ++i) {
      const bool is_kin = static_cast<int>(i) == added.parent || branches_[i].parent == added.parent;
      if (!is_clear_of(branches_[i], is_kin)) return false;
    }
    return std::ranges::all_of(siblings, [&](const VesselBranch& other) { return is_clear_of(other, true); });
  }

  /// Lets two branches follow where one ends: alike, or one that goes on and a side branch.
  void split(std::size_t parent) {
    constexpr double kThinnest_mm = 1.2;
    const auto& line = branches_[parent].points;
    const VesselPoint end = line.back();
    const glm::dvec3 along = glm::normalize(end.position_mm - line[line.size() - 3].position_mm);
    for (int attempt = 0; attempt < 20; ++attempt) {
      const double share = uniform(0, 1) < 0.5 ? uniform(0.35, 0.5) : uniform(0.03, 0.2);  // of the cube
      const double thin_mm = end.radius_mm * std::cbrt(share), wide_mm = end.radius_mm * std::cbrt(1 - share);
      if (thin_mm < kThinnest_mm) continue;
      const double around = uniform(0, 2 * std::numbers::pi);
      const double thin_angle = uniform(0.65, 1.2), wide_angle = thin_angle * share / (1 - share);
      std::vector<VesselBranch> added;
      for (const bool is_thin : {false, true}) {
        const double radius_mm = is_thin ? thin_mm : wide_mm;
        const glm::dvec3 direction =
            turned(along, is_thin ? thin_angle : wide_angle, is_thin ? around : around + std::numbers::pi);
        VesselBranch next = branch({end, direction}, radius_mm,
                                   2.5 * end.radius_mm + radius_mm * uniform(3, 8), static_cast<int>(parent));
        if (is_clear(next, added)) added.push_back(std::move(next));
      }
      if (added.size() < 2) continue;
      branches_.insert(branches_.end(), added.begin(), added.end());
      return;
    }
  }

  std::mt19937 random_;
  std::vector<VesselBranch> branches_;
};

}  // namespace

VesselTree branching_tree(std::uint32_t seed) {
  // A trunk that cannot split is no tree.
  for (std::uint32_t next = seed;; next += 100'000)
    if (std::vector<VesselBranch> branches = Growth(next).grow(); branches.size() >= 5)
      return {std::move(branches), fmt::format("tree {}", seed)};
}

}  // namespace xraycast
