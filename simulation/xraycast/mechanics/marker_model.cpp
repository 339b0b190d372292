#include "xraycast/mechanics/marker_model.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/printable.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace xraycast {

const std::vector<std::string>& marker_materials() {
  static const std::vector<std::string> names{"platinum", "platinum-iridium", "gold", "tantalum", "tungsten"};
  return names;
}

std::vector<MarkerModel> usual_markers(double radius_mm, double inner_radius_mm, double length_mm,
                                       const std::optional<BalloonModel>& balloon) {
  if (balloon) {
    std::vector<MarkerModel> bands(2);
    const auto middle_at = [&](MarkerModel& band, double from_tip_mm) {
      band.thickness_mm = std::min(band.thickness_mm, radius_mm - inner_radius_mm);
      band.length_mm = std::min(band.length_mm, length_mm);
      band.from_tip_mm = std::clamp(from_tip_mm - 0.5 * band.length_mm, 0.0, length_mm - band.length_mm);
    };
    middle_at(bands[0], balloon->from_tip_mm);
    middle_at(bands[1], balloon->from_tip_mm + balloon->length_mm);
    return bands;
  }
  if (inner_radius_mm > 0) return {};
  constexpr double kCoil_mm = 30, kShare = 0.25;
  return {
      {.length_mm = std::min(kCoil_mm, length_mm), .thickness_mm = radius_mm * (1 - std::sqrt(1 - kShare))}};
}

void check(const std::vector<MarkerModel>& markers, double radius_mm, double inner_radius_mm,
           double length_mm, const std::string& origin) {
  constexpr std::size_t kMost = 50;
  constexpr double kShortest_mm = 0.1, kThinnest_mm = 0.001, kRounding_mm = 1e-9;
  if (markers.size() > kMost)
    throw InputError("{}: {} markers; give at most {}", origin, markers.size(), kMost);
  for (std::size_t m = 0; m < markers.size(); ++m) {
    const MarkerModel& marker = markers[m];
    const std::string where = fmt::format("{}: markers[{}]", origin, m);
    const std::vector<std::string>& known = marker_materials();
    if (std::find(known.begin(), known.end(), marker.material) == known.end())
      throw InputError("{}: \"material\" is {}; must be {}", where, excerpt(marker.material),
                       fmt::join(known, ", "));
    if (!(marker.from_tip_mm >= 0 && std::isfinite(marker.from_tip_mm)))
      throw InputError("{}: \"from_tip_mm\" is {:g}; it must be zero or more", where, marker.from_tip_mm);
    if (!(marker.length_mm >= kShortest_mm && std::isfinite(marker.length_mm)))
      throw InputError("{}: \"length_mm\" is {:g}; it must be at least {:g}", where, marker.length_mm,
                       kShortest_mm);
    const double wall_mm = radius_mm - inner_radius_mm;
    if (!(marker.thickness_mm >= kThinnest_mm && marker.thickness_mm <= wall_mm + kRounding_mm))
      throw InputError("{}: \"thickness_mm\" is {:g}; it must be {:g} to the instrument's wall, {:g}", where,
                       marker.thickness_mm, kThinnest_mm, wall_mm);
    if (marker.end_from_tip_mm() > length_mm + kRounding_mm)
      throw InputError("{}: ends {:g} mm from the tip, beyond the {:g} mm of the sections", where,
                       marker.end_from_tip_mm(), length_mm);
  }
}

}  // namespace xraycast
