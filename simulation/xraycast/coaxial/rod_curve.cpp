#include "xraycast/coaxial/rod_curve.hpp"

#include "xraycast/base/wide_vectors.hpp"
#include "xraycast/coaxial/rod_curve_lanes.hpp"
#include "xraycast/mechanics/lanes.hpp"

#include <algorithm>

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

/// Of four searches or, where there are less, the first one several times.
XRAYCAST_WIDE_VECTORS
void find_four_places(const RodState& rod, std::span<NearestPlace> searches) {
  LaneSources<Lanes, NearestPlace> from;
  NearestPlaces four;
  for (std::size_t k = 0; k < kLanes; ++k) {
    from[k] = &searches[k < searches.size() ? k : 0];
    four.segments[k] = from[k]->place.segment;
    four.t[k] = from[k]->place.t;
  }
  four.point_mm = gathered_triple<Lanes, NearestPlace>(
      from, [](const NearestPlace& s) -> auto& { return s.point_mm; });
  four.search(rod);
  for (std::size_t k = 0; k < searches.size(); ++k) {
    searches[k].place = {four.segments[k], four.t[k]};
    searches[k].offset_mm = lane_vector<Vector3d>(four.offset_mm, k);
  }
}

}  // namespace

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
  return place_on(rod, low, from_tip);
}

RodPlace place_on(const Rod& rod, std::size_t segment, double from_tip_mm) {
  const auto [first_mm, last_mm] = ends_of(rod, segment);
  return {segment, (first_mm - from_tip_mm) / (first_mm - last_mm)};
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
