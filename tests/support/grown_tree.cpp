#include "support/grown_tree.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace xraycast {
namespace {

constexpr std::int64_t kSize = 100;

/// Numbers that no library's distributions have a say in.
class Dice {
 public:
  explicit Dice(std::uint32_t seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_()) + 0.5) / 4294967296.0;
  }
  double normal() {  // Box and Muller
    const double r = std::sqrt(-2 * std::log(uniform(0, 1)));
    return r * std::cos(uniform(0, 2 * std::numbers::pi));
  }
  glm::dvec3 point(double low, double high) {
    const double x = uniform(low, high), y = uniform(low, high);
    return {x, y, uniform(low, high)};
  }

 private:
  std::mt19937 engine_;
};

/// A place of the tree; a branch leads to it from its parent.
struct Place {
  glm::dvec3 at;
  int parent;
  int ends = 0;  ///< that are reached through it
};

struct Nearest {
  int place = 1;
  glm::dvec3 at{0, 0, 0};
  double distance = 1e9;
};

Nearest nearest(const std::vector<Place>& places, const glm::dvec3& point) {
  Nearest best;
  for (std::size_t i = 1; i < places.size(); ++i) {
    const glm::dvec3 a = places[static_cast<std::size_t>(places[i].parent)].at, b = places[i].at;
    const double t = glm::clamp(glm::dot(point - a, b - a) / glm::dot(b - a, b - a), 0.05, 0.95);
    const glm::dvec3 at = glm::mix(a, b, t);
    if (const double distance = glm::distance(at, point); distance < best.distance)
      best = {static_cast<int>(i), at, distance};
  }
  return best;
}

/// The places of a tree; ends are counted.
std::vector<Place> grow(int ends, Dice& dice) {
  std::vector<Place> places{{{50, 50, 4}, -1}, {{50 + dice.uniform(-15, 15), 50, 30}, 0}};
  for (int count = 1; count < ends; ++count) {
    double least = 0.45 * kSize / std::cbrt(count + 1);
    glm::dvec3 end;
    Nearest fork;
    do {
      end = dice.point(5, kSize - 5);
      fork = nearest(places, end);
      least *= 0.97;
    } while (fork.distance < least);
    const auto self = static_cast<int>(places.size());
    Place& split = places[static_cast<std::size_t>(fork.place)];
    const Place middle{glm::mix(fork.at, end, 0.25), split.parent};
    split.parent = self;
    places.push_back(middle);
    places.push_back({end, self});
  }
  std::vector<bool> is_parent(places.size());
  for (const Place& place : places)
    if (place.parent >= 0) is_parent[static_cast<std::size_t>(place.parent)] = true;
  for (std::size_t i = 0; i < places.size(); ++i)
    if (!is_parent[i])
      for (int at = static_cast<int>(i); at >= 0; at = places[static_cast<std::size_t>(at)].parent)
        ++places[static_cast<std::size_t>(at)].ends;
  return places;
}

/// The lumen, three times as fine along each axis.
class FineLumen {
 public:
  static constexpr std::int64_t kFine = 3;
  FineLumen() : mask_({.size = Index3(kFine * kSize)}) {}

  void add_ball(const glm::dvec3& centre, double radius) {
    const glm::dvec3 at = static_cast<double>(kFine) * (centre + 0.5) - 0.5;
    const double reach = kFine * radius;
    const Index3 lower = glm::max(Index3(glm::floor(at - reach)), Index3(0)),
                 upper = glm::min(Index3(glm::ceil(at + reach)), mask_.geometry.size - Index3(1));
    for (std::int64_t z = lower.z; z <= upper.z; ++z)
      for (std::int64_t y = lower.y; y <= upper.y; ++y)
        for (std::int64_t x = lower.x; x <= upper.x; ++x)
          if (glm::distance(glm::dvec3(x, y, z), at) <= reach) mask_[{x, y, z}] = 1;
  }

  double share(const Index3& voxel) const { return mean_in(mask_.voxels, voxel); }

  /// Shares of all voxels of the lumen blurred by a Gaussian of this width, in voxels.
  std::vector<double> blurred_shares(double blur) const {
    std::vector<float> values(mask_.voxels.begin(), mask_.voxels.end());
    for (int axis = 0; axis < 3 && blur > 0; ++axis) blur_along(axis, kFine * blur, values);
    std::vector<double> shares;
    for (std::int64_t i = 0; i < kSize * kSize * kSize; ++i)
      shares.push_back(mean_in(values, {i % kSize, i / kSize % kSize, i / (kSize * kSize)}));
    return shares;
  }

 private:
  template <typename Value>
  double mean_in(const std::vector<Value>& values, const Index3& voxel) const {
    double sum = 0;
    for (std::int64_t z = 0; z < kFine; ++z)
      for (std::int64_t y = 0; y < kFine; ++y)
        for (std::int64_t x = 0; x < kFine; ++x)
          sum += static_cast<double>(values[mask_.offset(kFine * voxel + Index3(x, y, z))]);
    return sum / (kFine * kFine * kFine);
  }

  /// Nothing lies beyond the grid.
  void blur_along(int axis, double sigma, std::vector<float>& values) const {
    const int reach = static_cast<int>(std::ceil(3 * sigma));
    std::vector<float> weights;
    float sum = 0;
    for (int k = -reach; k <= reach; ++k) {
      weights.push_back(static_cast<float>(std::exp(-0.5 * k * k / (sigma * sigma))));
      sum += weights.back();
    }
    const std::vector<float> before = values;
    for (std::size_t i = 0; i < values.size(); ++i) {
      const Index3 here = voxel_at(mask_.geometry, static_cast<std::int64_t>(i));
      float value = 0;
      for (int k = -reach; k <= reach; ++k) {
        Index3 there = here;
        there[axis] += k;
        if (mask_.contains(there))
          value += weights[static_cast<std::size_t>(k + reach)] * before[mask_.offset(there)];
      }
      values[i] = value / sum;
    }
  }

  Mask mask_;
};

}  // namespace

GrownTree grow_tree(const GrownTreeOptions& options) {
  Dice dice(options.seed);
  const std::vector<Place> places = grow(options.ends, dice);
  const VolumeGeometry grid{.size = Index3(kSize)};
  GrownTree tree{Volume(grid), Mask(grid), 0, {}};
  FineLumen lumen;
  for (std::size_t i = 1; i < places.size(); ++i) {
    const glm::dvec3 a = places[static_cast<std::size_t>(places[i].parent)].at, b = places[i].at;
    const double length = glm::distance(a, b);
    glm::dvec3 across = glm::cross(b - a, dice.point(-1, 1));
    across *= options.bend * length / glm::length(across);
    const int steps = static_cast<int>(std::ceil(2 * length));
    for (int k = 0; k <= steps; ++k) {
      const double t = static_cast<double>(k) / steps;
      const glm::dvec3 at = glm::mix(a, b, t) + std::sin(std::numbers::pi * t) * across;
      lumen.add_ball(at, options.end_radius * std::cbrt(places[i].ends));
      tree.centreline.push_back(at);
    }
  }
  const std::vector<double> seen = lumen.blurred_shares(options.blur);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const double share = lumen.share(voxel_at(grid, static_cast<std::int64_t>(i)));
    tree.lumen.voxels[i] = share > 1.0 / 14;
    tree.lumen_voxels += share;
    tree.noisy.hu()[i] = static_cast<std::int16_t>(
        std::lround(std::clamp(255 * seen[i] + options.noise * dice.normal(), 0.0, 255.0)));
  }
  return tree;
}

}  // namespace xraycast
