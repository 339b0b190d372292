#include "xraycast/coaxial/placed_stent.hpp"

#include "xraycast/catheter/lumen_profile.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace xraycast {

double PlacedStent::length_mm() const { return model.length_of_mm(radii_mm); }

double PlacedStent::ring_from_mm(std::size_t ring) const {
  double from_mm = this->from_mm();
  for (std::size_t r = 0; r < ring; ++r) from_mm += model.ring_height_mm(2 * radii_mm[r]) + model.link_mm;
  return from_mm;
}

double PlacedStent::ring_middle_mm(std::size_t ring) const {
  return ring_from_mm(ring) + 0.5 * model.ring_height_mm(2 * radii_mm[ring]);
}

double PlacedStent::radius_at_mm(double arc_mm) const {
  double from_mm = this->from_mm();
  for (std::size_t r = 0; r + 1 < radii_mm.size(); ++r) {
    const double to_mm = from_mm + model.ring_height_mm(2 * radii_mm[r]);
    from_mm = to_mm + model.link_mm;
    if (arc_mm < from_mm)
      return std::lerp(radii_mm[r], radii_mm[r + 1], std::max(0.0, arc_mm - to_mm) / model.link_mm);
  }
  return radii_mm.back();
}

double PlacedStent::mean_radius_mm() const {
  return std::accumulate(radii_mm.begin(), radii_mm.end(), 0.0) / static_cast<double>(radii_mm.size());
}

std::vector<YieldingWalls::Opening> PlacedStent::openings() const {
  std::vector<YieldingWalls::Opening> openings;
  double from_mm = this->from_mm();
  for (std::size_t r = 0; r < radii_mm.size(); ++r) {
    const double to_mm = from_mm + model.ring_height_mm(2 * radii_mm[r]);
    const bool is_first = r == 0, is_last = r + 1 == radii_mm.size();
    openings.push_back({.branch = branch,
                        .from_mm = from_mm - (is_first ? 0 : 0.5 * model.link_mm),
                        .to_mm = to_mm + (is_last ? 0 : 0.5 * model.link_mm),
                        .radius_mm = radii_mm[r],
                        .goes_on_before = !is_first,
                        .goes_on_behind = !is_last});
    from_mm = to_mm + model.link_mm;
  }
  return openings;
}

Malapposition malapposition(const PlacedStent& stent, const LumenDistanceField& walls) {
  constexpr int kPlaces = 100;
  Malapposition found;
  for (int i = 0; i <= kPlaces; ++i) {
    const double arc_mm = stent.from_mm() + i * stent.length_mm() / kPlaces;
    const double outside_mm = stent.radius_at_mm(arc_mm) + 0.5 * stent.model.strut_mm;
    const double away_mm = std::max(0.0, radius_mm(walls, stent.branch, arc_mm) - outside_mm);
    found.largest_mm = std::max(found.largest_mm, away_mm);
    if (away_mm > Malapposition::kNoticed_mm) found.share += 1.0 / (kPlaces + 1);
  }
  return found;
}

}  // namespace xraycast
