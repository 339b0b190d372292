#include "xraycast/fluoroscope/collimation.hpp"

#include "xraycast/fluoroscope/blur.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

/// Part of a line.
struct Stretch {
  double from = 0, to = 0;
  void narrow(double other_from, double other_to) {
    from = std::max(from, other_from);
    to = std::min(to, other_to);
  }
  double length() const { return std::max(0.0, to - from); }
};

/// Where |factor x + offset| <= half.
void narrow_to_band(Stretch& stretch, double factor, double offset, double half) {
  constexpr double kParallel = 1e-12;
  if (std::abs(factor) < kParallel) {
    if (std::abs(offset) > half) stretch.to = stretch.from;
    return;
  }
  const double one = (-half - offset) / factor, other = (half - offset) / factor;
  stretch.narrow(std::min(one, other), std::max(one, other));
}

}  // namespace

double open_area_mm2(const Collimation& blades, double width_mm, double height_mm, double round_mm) {
  const double cosine = std::cos(blades.turn_rad), sine = std::sin(blades.turn_rad);
  constexpr int kLines = 4000;  // for areas to 1e-4, since the opening is convex
  const double reach_mm = blades.width_mm * std::abs(sine) + blades.height_mm * std::abs(cosine);
  const double apart_mm = std::min(height_mm, reach_mm) / kLines;
  double area = 0;
  for (int line = 0; line < kLines; ++line) {
    const double y = (line + 0.5 - 0.5 * kLines) * apart_mm;
    Stretch open{-0.5 * width_mm, 0.5 * width_mm};
    narrow_to_band(open, cosine, sine * y, 0.5 * blades.width_mm);
    narrow_to_band(open, -sine, cosine * y, 0.5 * blades.height_mm);
    if (round_mm > 0) {
      const double half = std::sqrt(std::max(0.0, 0.25 * round_mm * round_mm - y * y));
      open.narrow(-half, half);
    }
    area += apart_mm * open.length();
  }
  return area;
}

std::vector<float> open_field(const View& view, const Collimation& collimation, double round_mm,
                              const EdgeProfile& edge) {
  std::vector<float> field(static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height));
  const double cosine = std::cos(collimation.turn_rad), sine = std::sin(collimation.turn_rad);
  std::size_t pixel = 0;
  for (int j = 0; j < view.height; ++j)
    for (int i = 0; i < view.width; ++i) {
      const double x = (i + 0.5 - 0.5 * view.width) * view.pixel_mm;
      const double y = (0.5 * view.height - j - 0.5) * view.pixel_mm;
      const double across = std::abs(cosine * x + sine * y), along = std::abs(cosine * y - sine * x);
      const auto beside = [&](double inside_mm) { return edge.at(inside_mm / view.pixel_mm); };
      double open = beside(0.5 * collimation.width_mm - across) * beside(0.5 * collimation.height_mm - along);
      if (round_mm > 0) open *= beside(0.5 * round_mm - std::hypot(x, y));
      field[pixel++] = static_cast<float>(open);
    }
  return field;
}

}  // namespace xraycast
