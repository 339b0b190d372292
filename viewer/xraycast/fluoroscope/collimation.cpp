#include "xraycast/fluoroscope/collimation.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

/// The integral of the cumulative normal distribution of a spread.
double integrated_step(double at_mm, double spread_mm) {
  if (!(spread_mm > 0)) return std::max(0.0, at_mm);
  const double z = at_mm / spread_mm;
  return at_mm * 0.5 * std::erfc(-z / std::numbers::sqrt2) +
         spread_mm * std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi);
}

/// What a pixel sees whose middle lies `inside_mm` within an opaque edge.
double beside_edge(double inside_mm, double pixel_mm, double spread_mm) {
  const double far_mm = 0.5 * pixel_mm + 8 * spread_mm;
  if (inside_mm >= far_mm) return 1;
  if (inside_mm <= -far_mm) return 0;
  return (integrated_step(inside_mm + 0.5 * pixel_mm, spread_mm) -
          integrated_step(inside_mm - 0.5 * pixel_mm, spread_mm)) /
         pixel_mm;
}

}  // namespace

std::vector<float> open_field(const View& view, const Collimation& collimation, double round_mm,
                              double spread_mm) {
  std::vector<float> field(static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height));
  const double cosine = std::cos(collimation.turn_rad), sine = std::sin(collimation.turn_rad);
  std::size_t pixel = 0;
  for (int j = 0; j < view.height; ++j)
    for (int i = 0; i < view.width; ++i) {
      const double x = (i + 0.5 - 0.5 * view.width) * view.pixel_mm;
      const double y = (0.5 * view.height - j - 0.5) * view.pixel_mm;
      const double across = std::abs(cosine * x + sine * y), along = std::abs(cosine * y - sine * x);
      double open = beside_edge(0.5 * collimation.width_mm - across, view.pixel_mm, spread_mm) *
                    beside_edge(0.5 * collimation.height_mm - along, view.pixel_mm, spread_mm);
      if (round_mm > 0) open *= beside_edge(0.5 * round_mm - std::hypot(x, y), view.pixel_mm, spread_mm);
      field[pixel++] = static_cast<float>(open);
    }
  return field;
}

}  // namespace xraycast
