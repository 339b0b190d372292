#pragma once

#include "xraycast/mechanics/rod.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

namespace xraycast {

// A rod's smooth centreline: the quadratic B-spline whose control points are the nodes. It passes through the
// middles of the edges along them, so that its tangent is continuous, and lies inside the polygon of a bend;
// beyond the tip it goes straight on. A distance to it does not jump when a point passes a node.

/// A place on a rod's centreline. Segment 0 runs from node 0 to the first edge's middle, segment i around
/// node i from middle to middle, the last one from the last middle to the tip and on.
struct RodPlace {
  std::size_t segment = 0;
  double t = 0;  ///< 0 to 1, beyond it before the first and after the last segment
};

/// The position and its derivatives by RodPlace::t as weights of three consecutive nodes, and the angle as
/// weights of those edges that end at these nodes.
struct RodWeights {
  static constexpr std::size_t kNodes = 3;
  using Weights = std::array<double, kNodes>;
  std::size_t first_node = 0;
  Weights position{}, slope{}, bend{}, theta{};

  static RodWeights at(const RodPlace& place, std::size_t node_count);
  static std::size_t first_node_of(std::size_t segment, std::size_t node_count) {
    return segment == 0 ? 0 : std::min(segment - 1, node_count - kNodes);
  }

  Eigen::Vector3d of(const Weights& weights, const RodState& state) const {
    return weights[0] * state.nodes_mm[first_node] + weights[1] * state.nodes_mm[first_node + 1] +
           weights[2] * state.nodes_mm[first_node + 2];
  }
  Eigen::Vector3d position_mm(const RodState& state) const { return of(position, state); }
  double theta_rad(const RodState& state) const {
    double sum = 0;
    for (std::size_t k = 0; k < kNodes; ++k)
      if (theta[k] != 0) sum += theta[k] * state.thetas_rad[first_node + k - 1];
    return sum;
  }
};

inline RodWeights RodWeights::at(const RodPlace& place, std::size_t node_count) {
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

/// Into the next or the previous segment, if there is one. The distance overshot is that of a parameter which
/// is about as fast there.
inline RodPlace carried_over(RodPlace place, std::size_t last_segment) {
  while (place.t > 1 && place.segment < last_segment) ++place.segment, place.t -= 1;
  while (place.t < 0 && place.segment > 0) --place.segment, place.t += 1;
  return place;
}

/// The place of a length from the tip, which is negative beyond it.
RodPlace place_of(const Rod& rod, double from_tip_mm);

/// The same where the segment is known.
RodPlace place_on(const Rod& rod, std::size_t segment, double from_tip_mm);

/// The inverse.
double from_tip_mm(const Rod& rod, const RodPlace& place);

/// A point, the place on a rod's centreline where the search for the nearest one starts, which replaces it,
/// and the way from there to the point.
struct NearestPlace {
  Eigen::Vector3d point_mm{0, 0, 0};
  RodPlace place;
  Eigen::Vector3d offset_mm{0, 0, 0};
};

/// The places nearest to points, found by Newton's method along the centreline, for several at once. What
/// turns back and passes close by elsewhere is not found.
void find_nearest_places(const RodState& rod, std::span<NearestPlace> searches);

/// The same for one point.
RodPlace nearest_place(const RodState& rod, RodPlace place, const Eigen::Vector3d& point_mm);

}  // namespace xraycast
