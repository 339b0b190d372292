#include "xraycast/reports/map_preview.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/reports/scale_ticks.hpp"
#include "xraycast/scene/canvas.hpp"

#include <fmt/format.h>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace xraycast {
namespace {

constexpr int kFont = 13, kRight = 12;
constexpr Colour kPaper{0.11, 0.11, 0.11}, kInk{0.9, 0.9, 0.9};

/// What the rows of a layer measure, row 0 on top.
struct RowScale {
  std::string unit;
  double first, per_row;  ///< at the middle of row 0, and from row to row

  double row_of(double value) const { return (value - first) / per_row; }
};

RowScale rows_of(const MapGeometry& geometry) {
  if (geometry.ray_layout == RayLayout::sphere)
    return {"deg", glm::degrees(geometry.theta_rad(0)),
            glm::degrees(geometry.theta_rad(1) - geometry.theta_rad(0))};
  return {"z, mm", geometry.top_mm, -geometry.row_spacing_mm};
}

std::string title_of(const MapGeometry& geometry, int layer) {
  const int layers = geometry.layers();
  if (geometry.ray_layout == RayLayout::rectangle)
    return fmt::format("view {} of {}: {:.1f} deg", layer + 1, layers,
                       glm::degrees(geometry.view_rad(layer)));
  const auto edge_mm = [&](int k) { return geometry.radii_mm[static_cast<std::size_t>(k)]; };
  return fmt::format("layer {} of {}: {:.1f} to {:.1f} mm{}", layer + 1, layers, edge_mm(layer),
                     edge_mm(layer + 1), geometry.has_outline() ? " at the widest" : "");
}

/// 8-bit RGB of a height that a canvas need not have.
struct Strip {
  int width, height;
  std::vector<std::uint8_t> rgb;
};

/// The scale to the left of a layer.
Strip scale_of(const MapGeometry& geometry) {
  constexpr int kRowsAtOnce = 4096;  // a canvas has at most 32,767
  constexpr double kLeastBetween = 2.5 * kFont, kTick = 6;
  const RowScale rows = rows_of(geometry);
  const double last = rows.first + rows.per_row * (geometry.height - 1);
  const std::vector<double> ticks = scale_ticks(std::min(rows.first, last), std::max(rows.first, last),
                                                kLeastBetween * std::abs(rows.per_row));
  Strip strip{kPreviewLeft, geometry.height, {}};
  for (int top = 0; top < geometry.height; top += kRowsAtOnce) {
    Canvas canvas(kPreviewLeft, std::min(kRowsAtOnce, geometry.height - top), kPaper);
    double last_baseline = std::numeric_limits<double>::infinity();
    for (const double tick : ticks) {
      const double y = std::floor(rows.row_of(tick) + 0.5) + 0.5 - top;
      canvas.line(std::array{glm::dvec2(kPreviewLeft - kTick, y), glm::dvec2(kPreviewLeft, y)}, kInk);
      // Whole within the strip, and the pixels of the next canvas go on where this one's end.
      const double baseline =
          std::max(kFont - 2.0 - top, std::min(y + 0.36 * kFont, geometry.height - 1.0 - top));
      if (std::abs(baseline - last_baseline) < kFont) continue;  // in a layer of few rows
      last_baseline = baseline;
      canvas.text({kPreviewLeft - kTick - 3, baseline}, fmt::format("{:g}", tick), kFont, kInk, Align::right);
    }
    const std::vector<std::uint8_t> rgb = canvas.rgb();
    strip.rgb.insert(strip.rgb.end(), rgb.begin(), rgb.end());
  }
  return strip;
}

/// The line above a layer.
Strip title(const MapGeometry& geometry, int layer, int width) {
  Canvas canvas(width, kPreviewTitle, kPaper);
  canvas.text({kPreviewLeft - 9, kPreviewTitle - 6}, rows_of(geometry).unit, kFont, kInk, Align::right);
  canvas.text({kPreviewLeft, kPreviewTitle - 6}, title_of(geometry, layer), kFont, kInk);
  return {width, kPreviewTitle, canvas.rgb()};
}

/// Wide enough for the layers and their titles.
int width_of(const MapGeometry& geometry) {
  Canvas canvas(1, 1, kPaper);
  double width = geometry.width;
  for (int k = 0; k < geometry.layers(); ++k)
    width = std::max(width, canvas.text_width(title_of(geometry, k), kFont));
  return kPreviewLeft + static_cast<int>(std::ceil(width)) + kRight;
}

/// How many layers lie beside each other: rows of about the same number, in a picture of a screen's shape.
int columns_of(int layers, int cell_width, int cell_height) {
  constexpr double kShape = 1.6;  // width over height
  int best = layers;
  double best_off = std::numeric_limits<double>::infinity();
  for (int rows = 1; rows <= layers; ++rows) {
    const int columns = (layers + rows - 1) / rows;
    const double off = std::abs(std::log(1.0 * columns * cell_width / (1.0 * rows * cell_height) / kShape));
    if (off < best_off) {
      best = columns;
      best_off = off;
    }
  }
  return best;
}

}  // namespace

PreviewWindow parse_preview_window(const std::string& name) {
  if (name == "auto") return PreviewWindow::automatic;
  if (name == "paper") return PreviewWindow::paper;
  throw InputError("`preview_window` {}: must be auto or paper", name);
}

RgbPicture map_preview(const BodyMap& map, PreviewWindow window) {
  const MapGeometry& geometry = map.geometry;
  const std::vector<std::uint8_t> greys = preview_of(map, window);
  const Strip scale = scale_of(geometry);
  const int cell_width = width_of(geometry), cell_height = kPreviewTitle + geometry.height;
  const int columns = columns_of(geometry.layers(), cell_width, cell_height);
  const int rows = (geometry.layers() + columns - 1) / columns;
  RgbPicture picture{columns * cell_width, rows * cell_height, {}};
  picture.rgb.assign(std::size_t{3} * static_cast<std::size_t>(picture.width) * picture.height,
                     static_cast<std::uint8_t>(std::lround(255 * kPaper.red)));
  const std::uint8_t* grey = greys.data();
  for (int k = 0; k < geometry.layers(); ++k) {
    const int left = k % columns * cell_width, top = k / columns * cell_height;
    const auto at = [&](int x, int y) {
      return picture.rgb.begin() + std::ptrdiff_t{3} * (std::ptrdiff_t{picture.width} * (top + y) + left + x);
    };
    const auto put = [&](const Strip& strip, int y) {
      for (int row = 0; row < strip.height; ++row)
        std::copy_n(strip.rgb.begin() + std::ptrdiff_t{3} * strip.width * row,
                    std::ptrdiff_t{3} * strip.width, at(0, y + row));
    };
    put(title(geometry, k, cell_width), 0);
    put(scale, kPreviewTitle);
    for (int y = 0; y < geometry.height; ++y) {
      auto to = at(kPreviewLeft, kPreviewTitle + y);
      for (int x = 0; x < geometry.width; ++x) to = std::fill_n(to, 3, *grey++);
    }
  }
  return picture;
}

}  // namespace xraycast
