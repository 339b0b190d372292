#include "xraycast/coaxial/rod_curve.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

using Eigen::Vector3d;

/// Of the middle of an edge, from the tip.
double middle_mm(const Rod& rod, std::size_t edge) {
  return 0.5 * (rod.from_tip_mm(edge) + rod.from_tip_mm(edge + 1));
}

/// Of a segment's ends, from the tip.
struct Ends {
  double first_mm, last_mm;
};
Ends ends_of(const Rod& rod, std::size_t segment) {
  const std::size_t last = rod.node_count() - 1;
  return {segment == 0 ? rod.from_tip_mm(0) : middle_mm(rod, segment - 1),
          segment == last ? 0 : middle_mm(rod, segment)};
}

/// Into the next or the previous segment, if there is one. The distance overshot is that of a parameter which
/// is about as fast there.
RodPlace carried_over(RodPlace place, std::size_t last_segment) {
  while (place.t > 1 && place.segment < last_segment) ++place.segment, place.t -= 1;
  while (place.t < 0 && place.segment > 0) --place.segment, place.t += 1;
  return place;
}

}  // namespace

RodWeights RodWeights::at(const RodPlace& place, std::size_t node_count) {
  const double t = place.t;
  if (place.segment == 0) return {0, {1 - 0.5 * t, 0.5 * t, 0}, {-0.5, 0.5, 0}, {0, 0, 0}, {0, 1, 0}};
  if (place.segment + 1 == node_count)
    return {node_count - kNodes, {0, 0.5 * (1 - t), 0.5 * (1 + t)}, {0, -0.5, 0.5}, {0, 0, 0}, {0, 0, 1}};
  return {place.segment - 1,
          {0.5 * (1 - t) * (1 - t), 0.5 + t * (1 - t), 0.5 * t * t},
          {t - 1, 1 - 2 * t, t},
          {1, -2, 1},
          {0, 1 - t, t}};
}

RodPlace place_of(const Rod& rod, double from_tip) {
  // The first edge whose middle is nearer to the tip.
  std::size_t low = 0, high = rod.node_count() - 1;
  while (low < high) {
    const std::size_t middle = (low + high) / 2;
    if (middle_mm(rod, middle) <= from_tip)
      high = middle;
    else
      low = middle + 1;
  }
  const auto [first_mm, last_mm] = ends_of(rod, low);
  return {low, (first_mm - from_tip) / (first_mm - last_mm)};
}

double from_tip_mm(const Rod& rod, const RodPlace& place) {
  const auto [first_mm, last_mm] = ends_of(rod, place.segment);
  return first_mm + place.t * (last_mm - first_mm);
}

RodPlace nearest_place(const RodState& rod, RodPlace place, const Vector3d& point_mm) {
  constexpr int kMaxIterations = 20;
  // Of the parameter. Newton's method leaves the square of its last step.
  constexpr double kTolerance = 1e-6, kLongest = 1;
  const std::size_t nodes = rod.nodes_mm.size();
  for (int i = 0; i < kMaxIterations; ++i) {
    const RodWeights weights = RodWeights::at(place, nodes);
    const Vector3d offset = point_mm - weights.position_mm(rod), slope = weights.of(weights.slope, rod);
    const double speed2 = slope.squaredNorm();
    // Beyond half the radius of a bend Newton's step might lead away.
    const double steepness = std::max(speed2 - offset.dot(weights.of(weights.bend, rod)), 0.5 * speed2);
    const double by = std::clamp(offset.dot(slope) / steepness, -kLongest, kLongest);
    place.t += by;
    place = carried_over(place, nodes - 1);
    if (std::abs(by) < kTolerance) break;
  }
  return place;
}

}  // namespace xraycast
