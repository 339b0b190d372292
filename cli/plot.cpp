#include "plot.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/image.hpp"

#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace xraycast::cli {
namespace {

namespace Algo = OIIO::ImageBufAlgo;

constexpr int kWidth = 900, kHeight = 560, kLeft = 80, kRight = 24, kTop = 48, kBottom = 60;
constexpr int kFont = 15;
using Colour = std::array<float, 3>;
constexpr Colour kInk{0.15f, 0.15f, 0.18f}, kGrid{0.87f, 0.87f, 0.89f};
constexpr std::array<Colour, 6> kColours{{{0.12f, 0.40f, 0.75f},
                                          {0.85f, 0.37f, 0.10f},
                                          {0.16f, 0.55f, 0.24f},
                                          {0.60f, 0.20f, 0.60f},
                                          {0.45f, 0.45f, 0.10f},
                                          {0.10f, 0.55f, 0.60f}}};

/// What an axis shows, its ends moved out to round numbers.
struct Axis {
  double low = std::numeric_limits<double>::infinity(), high = -low, step = 1;

  void include(double value) {
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
    // Angles are read in sixths of a right angle.
    for (const double angle : {60.0, 30.0, 15.0})
      if (low == 0 && std::abs(high - 360) < angle && angle >= rough) step = angle;
    low = std::floor(low / step + 1e-9) * step;
    high = std::ceil(high / step - 1e-9) * step;
  }
};

void line(OIIO::ImageBuf& image, double x1, double y1, double x2, double y2, const Colour& colour) {
  Algo::render_line(image, static_cast<int>(std::lround(x1)), static_cast<int>(std::lround(y1)),
                    static_cast<int>(std::lround(x2)), static_cast<int>(std::lround(y2)), colour);
}

void text(OIIO::ImageBuf& image, int x, int y, const std::string& words, const Colour& colour = kInk,
          Algo::TextAlignX align = Algo::TextAlignX::Left) {
  Algo::render_text(image, x, y, words, kFont, "DejaVuSans", colour, align);
}

}  // namespace

void check_plot(const std::filesystem::path& path) {
  if (extension_of(path) != ".png")
    throw InputError("--plot {}: a plot is a PNG; end its name in .png", path.string());
  check_writable(path);
}

void write_plot(const std::string& title, const std::string& x_label, const std::string& y_label,
                const std::vector<Curve>& curves, const std::filesystem::path& path) {
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

  OIIO::ImageBuf image(OIIO::ImageSpec(kWidth, kHeight, 3, OIIO::TypeDesc::UINT8));
  Algo::fill(image, {1.0f, 1.0f, 1.0f});
  for (double x = x_axis.low; x <= x_axis.high + 0.5 * x_axis.step; x += x_axis.step) {
    line(image, at_x(x), kTop, at_x(x), kHeight - kBottom, kGrid);
    text(image, static_cast<int>(at_x(x)), kHeight - kBottom + 20, fmt::format("{:g}", x), kInk,
         Algo::TextAlignX::Center);
  }
  for (double y = y_axis.low; y <= y_axis.high + 0.5 * y_axis.step; y += y_axis.step) {
    line(image, kLeft, at_y(y), kWidth - kRight, at_y(y), kGrid);
    text(image, kLeft - 8, static_cast<int>(at_y(y)) + 5, fmt::format("{:g}", std::round(y * 1e6) / 1e6),
         kInk, Algo::TextAlignX::Right);
  }
  line(image, kLeft, kTop, kLeft, kHeight - kBottom, kInk);
  line(image, kLeft, kHeight - kBottom, kWidth - kRight, kHeight - kBottom, kInk);
  text(image, kLeft, 20, title);
  text(image, kLeft - 60, kTop - 10, y_label);
  text(image, kWidth - kRight, kHeight - 14, x_label, kInk, Algo::TextAlignX::Right);

  for (std::size_t c = 0; c < curves.size(); ++c) {
    const Colour& colour = kColours[c % kColours.size()];
    const auto& points = curves[c].points;
    const bool has_spots = points.size() < 50;  // more run into each other
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double x = at_x(points[i].first), y = at_y(points[i].second);
      for (int spot = -2; has_spots && spot <= 2; ++spot)
        line(image, x - 2, y + spot, x + 2, y + spot, colour);
      if (i == 0) continue;
      const double x0 = at_x(points[i - 1].first), y0 = at_y(points[i - 1].second);
      line(image, x0, y0, x, y, colour);
      line(image, x0, y0 + 1, x, y + 1, colour);
    }
  }
  // The legend stands in the upper corner where there are fewer points.
  int on_right = 0;
  for (const Curve& curve : curves)
    for (const auto& [x, y] : curve.points)
      if (at_y(y) < kTop + 20 * (static_cast<int>(curves.size()) + 1))
        on_right += 2 * at_x(x) > kLeft + kWidth - kRight ? 1 : -1;
  for (std::size_t c = 0; curves.size() > 1 && c < curves.size(); ++c) {
    const int y = kTop + 20 + 20 * static_cast<int>(c);
    const int width = Algo::text_size(curves[c].name, kFont, "DejaVuSans").width();
    const int left = on_right > 0 ? kLeft + 12 : kWidth - kRight - 8 - width;
    Algo::fill(image, {1.0f, 1.0f, 1.0f}, OIIO::ROI(left - 4, left + width + 4, y - kFont, y + 5));
    text(image, left, y, curves[c].name, kColours[c % kColours.size()]);
  }
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(3) * kWidth * kHeight);
  image.get_pixels(image.roi(), OIIO::TypeDesc::UINT8, pixels.data());
  write_png(pixels, kWidth, kHeight, 3, path);
}

}  // namespace xraycast::cli
