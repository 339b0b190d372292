#pragma once

#include "xraycast/coaxial/rod_curve.hpp"
#include "xraycast/mechanics/lanes.hpp"
#include "xraycast/mechanics/rod.hpp"

#include <array>
#include <cstddef>

namespace xraycast {

// A rod's centreline (see RodPlace) at four places at once.

/// Three nodes in a row, for each of four places.
struct NodeTriples {
  Triple<Lanes> first, second, third;

  /// From these nodes on.
  [[gnu::always_inline]] NodeTriples(const RodState& rod, const LaneIndices& at) {
    std::array<const double*, kLanes> from;
    for (std::size_t k = 0; k < kLanes; ++k) from[k] = rod.nodes_mm[at[k]].data();
    const auto rows = [&from](std::size_t offset) __attribute__((always_inline)) {
      return transposed(load(from[0] + offset), load(from[1] + offset), load(from[2] + offset),
                        load(from[3] + offset));
    };
    const auto [x0, y0, z0, x1] = rows(0);
    const auto [y1, z1, x2, y2] = rows(4);
    first = {x0, y0, z0};
    second = {x1, y1, z1};
    third = {x2, y2, Lanes{from[0][8], from[1][8], from[2][8], from[3][8]}};
  }

  [[gnu::always_inline]] Triple<Lanes> weighted(const std::array<Lanes, RodWeights::kNodes>& weights) const {
    return weights[0] * first + weights[1] * second + weights[2] * third;
  }
};

/// The segments that four places lie on, by their parameter: start + t linear + t^2 quadratic.
struct Parabolas {
  Triple<Lanes> start_mm, linear, quadratic;

  [[gnu::always_inline]] Parabolas(const RodState& rod, const LaneIndices& segments) {
    const std::size_t last = rod.nodes_mm.size() - 1;
    LaneIndices first_nodes;
    Lanes is_first{}, is_last{};
    for (std::size_t k = 0; k < kLanes; ++k) {
      first_nodes[k] = RodWeights::first_node_of(segments[k], last + 1);
      is_first[k] = segments[k] == 0;
      is_last[k] = segments[k] == last;
    }
    const NodeTriples nodes(rod, first_nodes);
    linear = nodes.second - nodes.first;
    start_mm = nodes.first + all<Lanes>(0.5) * linear;
    quadratic = all<Lanes>(0.5) * ((nodes.third - nodes.second) - linear);
    if (!any(is_first > 0.0) && !any(is_last > 0.0)) return;
    // Half an edge each, and straight.
    const auto choose_end = [&](const Triple<Lanes>& of_first, const Triple<Lanes>& of_last,
                                Triple<Lanes>& value) __attribute__((always_inline)) {
      value.x = choose(is_first > 0.0, of_first.x, choose(is_last > 0.0, of_last.x, value.x));
      value.y = choose(is_first > 0.0, of_first.y, choose(is_last > 0.0, of_last.y, value.y));
      value.z = choose(is_first > 0.0, of_first.z, choose(is_last > 0.0, of_last.z, value.z));
    };
    const Triple<Lanes> after_first = all<Lanes>(0.5) * (nodes.second - nodes.first),
                        before_last = all<Lanes>(0.5) * (nodes.third - nodes.second), none{};
    choose_end(nodes.first, nodes.second + before_last, start_mm);
    choose_end(after_first, before_last, linear);
    choose_end(none, none, quadratic);
  }

  [[gnu::always_inline]] Triple<Lanes> at_mm(Lanes t) const {
    return start_mm + t * (linear + t * quadratic);
  }
  [[gnu::always_inline]] Triple<Lanes> slope(Lanes t) const { return linear + (2.0 * t) * quadratic; }
};

/// Four points and the places nearest to them; see find_nearest_places.
struct NearestPlaces {
  Triple<Lanes> point_mm;
  LaneIndices segments;  ///< where the search starts, and where it ends
  Lanes t;
  Triple<Lanes> offset_mm;  ///< from there to the point

  [[gnu::always_inline]] void search(const RodState& rod) {
    constexpr int kMaxIterations = 20;
    // Of the parameter. Newton's method leaves the square of its last step.
    constexpr double kTolerance = 1e-6, kLongest = 1;
    const std::size_t last = rod.nodes_mm.size() - 1;
    Parabolas curve(rod, segments);
    LaneMask is_off = t == t;
    for (int i = 0; i < kMaxIterations && any(is_off); ++i) {
      const Triple<Lanes> offset = point_mm - curve.at_mm(t), half_bend = curve.quadratic,
                          slope = curve.slope(t);
      const Lanes speed2 = dot(slope, slope), bent = speed2 - 2.0 * dot(offset, half_bend);
      // Beyond half the radius of a bend Newton's step might lead away.
      const Lanes steepness = choose(bent > 0.5 * speed2, bent, 0.5 * speed2);
      Lanes by = dot(offset, slope) / steepness;
      by = choose(by > kLongest, all<Lanes>(kLongest), choose(by < -kLongest, all<Lanes>(-kLongest), by));
      // What has converged stays as it is while others go on.
      t = choose(is_off, t + by, t);
      is_off = is_off & (magnitude(by) >= kTolerance);
      if (!any((t > 1.0) | (t < 0.0))) continue;
      bool is_elsewhere = false;
      for (std::size_t k = 0; k < kLanes; ++k) {
        const RodPlace place = carried_over({segments[k], t[k]}, last);
        is_elsewhere |= place.segment != segments[k];
        segments[k] = place.segment;
        t[k] = place.t;
      }
      if (is_elsewhere) curve = Parabolas(rod, segments);
    }
    offset_mm = point_mm - curve.at_mm(t);
  }
};

}  // namespace xraycast
