#include "xraycast/coaxial/rod_curve.hpp"

#include "xraycast/base/wide_vectors.hpp"
#include "xraycast/mechanics/lanes.hpp"

#include <algorithm>
#include <array>
#include <vector>

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

/// A segment by its parameter: start + t linear + t^2 quadratic.
struct Parabola {
  Vector3d start_mm, linear, quadratic;

  Parabola() = default;
  Parabola(const RodState& rod, std::size_t segment) {
    const std::vector<Vector3d>& nodes = rod.nodes_mm;
    const std::size_t last = nodes.size() - 1;
    if (segment == 0 || segment == last) {
      const Vector3d &from = nodes[segment == 0 ? 0 : last - 1], &to = nodes[segment == 0 ? 1 : last];
      linear = 0.5 * (to - from);
      start_mm = segment == 0 ? from : Vector3d(from + linear);
      quadratic.setZero();
      return;
    }
    const Vector3d &before = nodes[segment - 1], &here = nodes[segment], &after = nodes[segment + 1];
    linear = here - before;
    start_mm = before + 0.5 * linear;
    quadratic = 0.5 * ((after - here) - linear);
  }
};

/// Those of four searches.
struct Parabolas {
  Triple<Lanes> start_mm, linear, quadratic;

  [[gnu::always_inline]] explicit Parabolas(const std::array<Parabola, kLanes>& of) {
    const LaneSources<Lanes, Parabola> from{&of[0], &of[1], &of[2], &of[3]};
    start_mm = gathered_triple<Lanes, Parabola>(
        from, [](const Parabola& p) -> auto& { return p.start_mm; });
    linear = gathered_triple<Lanes, Parabola>(
        from, [](const Parabola& p) -> auto& { return p.linear; });
    quadratic = gathered_triple<Lanes, Parabola>(
        from, [](const Parabola& p) -> auto& { return p.quadratic; });
  }
  [[gnu::always_inline]] Triple<Lanes> at_mm(Lanes t) const {
    return start_mm + t * (linear + t * quadratic);
  }
};

/// Of four searches or, where there are less, the first one several times.
XRAYCAST_WIDE_VECTORS
void find_four_places(const RodState& rod, std::span<NearestPlace> searches) {
  constexpr int kMaxIterations = 20;
  // Of the parameter. Newton's method leaves the square of its last step.
  constexpr double kTolerance = 1e-6, kLongest = 1;
  const std::size_t last = rod.nodes_mm.size() - 1;
  std::array<RodPlace, kLanes> places;
  std::array<Parabola, kLanes> segments;
  LaneSources<Lanes, NearestPlace> from;
  Lanes t{};
  for (std::size_t k = 0; k < kLanes; ++k) {
    from[k] = &searches[k < searches.size() ? k : 0];
    places[k] = from[k]->place;
    segments[k] = Parabola(rod, places[k].segment);
    t[k] = places[k].t;
  }
  const auto point_mm = gathered_triple<Lanes, NearestPlace>(
      from, [](const NearestPlace& s) -> auto& { return s.point_mm; });
  Parabolas curve(segments);
  LaneMask is_off = t == t;
  for (int i = 0; i < kMaxIterations && any(is_off); ++i) {
    const Triple<Lanes> offset = point_mm - curve.at_mm(t), half_bend = curve.quadratic,
                        slope = curve.linear + (2.0 * t) * half_bend;
    const Lanes speed2 = dot(slope, slope), bent = speed2 - 2.0 * dot(offset, half_bend);
    // Beyond half the radius of a bend Newton's step might lead away.
    const Lanes steepness = choose(bent > 0.5 * speed2, bent, 0.5 * speed2);
    Lanes by = dot(offset, slope) / steepness;
    by = choose(by > kLongest, all<Lanes>(kLongest), choose(by < -kLongest, all<Lanes>(-kLongest), by));
    // What has converged stays as it is while others go on.
    t = choose(is_off, t + by, t);
    is_off = is_off & (magnitude(by) >= kTolerance);
    if (!any(t > 1.0) && !any(t < 0.0)) continue;
    for (std::size_t k = 0; k < kLanes; ++k) {
      const std::size_t before = places[k].segment;
      places[k] = carried_over({before, t[k]}, last);
      if (places[k].segment == before) continue;
      t[k] = places[k].t;
      segments[k] = Parabola(rod, places[k].segment);
    }
    curve = Parabolas(segments);
  }
  const Triple<Lanes> offset = point_mm - curve.at_mm(t);
  for (std::size_t k = 0; k < searches.size(); ++k) {
    searches[k].place = {places[k].segment, t[k]};
    searches[k].offset_mm = lane_vector<Vector3d>(offset, k);
  }
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

void find_nearest_places(const RodState& rod, std::span<NearestPlace> searches) {
  for (std::size_t first = 0; first < searches.size(); first += kLanes)
    find_four_places(rod, searches.subspan(first, std::min(kLanes, searches.size() - first)));
}

RodPlace nearest_place(const RodState& rod, RodPlace place, const Vector3d& point_mm) {
  NearestPlace search{point_mm, place};
  find_nearest_places(rod, {&search, 1});
  return search.place;
}

}  // namespace xraycast
