#include "xraycast/reports/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

namespace xraycast {
namespace {

constexpr int kWidth = 900, kHeight = 560, kLeft = 80, kRight = 24, kTop = 48, kBottom = 60;
constexpr int kFont = 15;
constexpr Colour kPaper{1, 1, 1}, kInk{0.15, 0.15, 0.18}, kGrid{0.87, 0.87, 0.89};
constexpr std::array<Colour, 8> kColours{{{0.12, 0.40, 0.75},
                                          {0.85, 0.37, 0.10},
                                          {0.16, 0.55, 0.24},
                                          {0.60, 0.20, 0.60},
                                          {0.45, 0.45, 0.10},
                                          {0.10, 0.55, 0.60},
                                          {0.92, 0.30, 0.55},
                                          {0.25, 0.25, 0.28}}};

/// Strokes and gaps, in pixels; round ends take 2 of a gap. They differ where colours do not for an eye.
std::span<const double> dashes_of(const Curve& curve) {
  static const std::array<std::vector<double>, 8> patterns{
      {{}, {10, 7}, {1, 5}, {12, 6, 1, 6}, {24, 8}, {12, 5, 1, 5, 1, 5}, {5, 6}, {24, 6, 1, 6}}};
  return patterns[curve.dashes % patterns.size()];
}

/// The range of an axis, extended to round numbers.
struct Axis {
  double low = std::numeric_limits<double>::infinity(), high = -low, step = 1;
  bool is_whole = true;  ///< as numbers of runs are: then so are its steps

  void include(double value) {
    is_whole = is_whole && value == std::floor(value);
    low = std::min(low, value);
    high = std::max(high, value);
  }

  void round() {
    if (!(high > low)) {
      low -= 1;
      high += 1;
    }
    const double rough = (high - low) / 6, decade = std::pow(10, std::floor(std::log10(rough)));
    for (const double nice : {10.0, 5.0, 2.0, 1.0})
      if (nice * decade >= rough) step = nice * decade;
    // Angles are labelled in multiples of 15 degrees.
    for (const double angle : {60.0, 30.0, 15.0})
      if (low == 0 && std::abs(high - 360) < angle && angle >= rough) step = angle;
    if (is_whole) step = std::max(step, 1.0);
    low = std::floor(low / step + 1e-9) * step;
    high = std::ceil(high / step - 1e-9) * step;
  }
};

/// A line of one pixel along or across, through the middles of pixels.
void ruled(Canvas& canvas, double x1, double y1, double x2, double y2, const Colour& colour) {
  const auto crisp = [](double at) { return std::floor(at) + 0.5; };
  canvas.line(std::array{glm::dvec2(crisp(x1), crisp(y1)), glm::dvec2(crisp(x2), crisp(y2))}, colour);
}

Colour colour_of(const std::vector<Curve>& curves, std::size_t index) {
  return curves[index].colour.value_or(kColours[index % kColours.size()]);
}

/// Sums of steps miss zero by a rounding, from below too.
std::string tick_label(double value, double step) {
  return fmt::format("{:g}", std::abs(value) < 1e-6 * step ? 0 : value);
}

void text(Canvas& canvas, double x, double y, const std::string& words, const Colour& colour = kInk,
          Align align = Align::left) {
  canvas.text({x, y}, words, kFont, colour, align);
}

}  // namespace

RgbPicture plot(const std::string& title, const std::string& x_label, const std::string& y_label,
                const std::vector<Curve>& curves) {
  Axis x_axis, y_axis;
  for (const Curve& curve : curves)
    for (const auto& [x, y] : curve.points) {
      x_axis.include(x);
      y_axis.include(y);
    }
  x_axis.round();
  y_axis.round();
  const auto at_x = [&](double x) {
    return kLeft + (x - x_axis.low) / (x_axis.high - x_axis.low) * (kWidth - kLeft - kRight);
  };
  const auto at_y = [&](double y) {
    return kHeight - kBottom - (y - y_axis.low) / (y_axis.high - y_axis.low) * (kHeight - kTop - kBottom);
  };

  Canvas canvas(kWidth, kHeight, kPaper);
  for (double x = x_axis.low; x <= x_axis.high + 0.5 * x_axis.step; x += x_axis.step) {
    ruled(canvas, at_x(x), kTop, at_x(x), kHeight - kBottom, kGrid);
    text(canvas, at_x(x), kHeight - kBottom + 20, tick_label(x, x_axis.step), kInk, Align::centre);
  }
  for (double y = y_axis.low; y <= y_axis.high + 0.5 * y_axis.step; y += y_axis.step) {
    ruled(canvas, kLeft, at_y(y), kWidth - kRight, at_y(y), kGrid);
    text(canvas, kLeft - 8, at_y(y) + 5, tick_label(y, y_axis.step), kInk, Align::right);
  }
  ruled(canvas, kLeft, kTop, kLeft, kHeight - kBottom, kInk);
  ruled(canvas, kLeft, kHeight - kBottom, kWidth - kRight, kHeight - kBottom, kInk);
  text(canvas, kLeft, 20, title);
  text(canvas, kLeft - 60, kTop - 10, y_label);
  text(canvas, kWidth - kRight, kHeight - 14, x_label, kInk, Align::right);

  for (std::size_t c = 0; c < curves.size(); ++c) {
    const Colour colour = colour_of(curves, c);
    std::vector<glm::dvec2> points;
    for (const auto& [x, y] : curves[c].points) points.emplace_back(at_x(x), at_y(y));
    canvas.line(points, colour, 2, dashes_of(curves[c]));
    if (points.size() < 50)  // more spots would overlap
      for (const glm::dvec2& point : points) canvas.spot(point, 3, colour);
  }
  // The legend is drawn in the upper corner with fewer points.
  int on_right = 0;
  for (const Curve& curve : curves)
    for (const auto& [x, y] : curve.points)
      if (at_y(y) < kTop + 20 * (static_cast<int>(curves.size()) + 1))
        on_right += 2 * at_x(x) > kLeft + kWidth - kRight ? 1 : -1;
  const bool has_dashes = std::ranges::any_of(curves, [](const Curve& curve) { return curve.dashes > 0; });
  const double sample = has_dashes ? 64 : 0;  // of the line, before its name
  for (std::size_t c = 0; curves.size() > 1 && c < curves.size(); ++c) {
    const double y = kTop + 20 + 20.0 * static_cast<double>(c);
    const double width = sample + canvas.text_width(curves[c].name, kFont);
    const double left = on_right > 0 ? kLeft + 12 : kWidth - kRight - 8 - width;
    canvas.fill({left - 4, y - kFont, width + 8, kFont + 5}, kPaper);
    const Colour colour = colour_of(curves, c);
    if (has_dashes)
      canvas.line(std::array{glm::dvec2(left, y - 5), glm::dvec2(left + sample - 10, y - 5)}, colour, 2,
                  dashes_of(curves[c]));
    text(canvas, left + sample, y, curves[c].name, colour);
  }
  return {kWidth, kHeight, canvas.rgb()};
}

}  // namespace xraycast
