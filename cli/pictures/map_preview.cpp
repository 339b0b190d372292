#include "pictures/map_preview.hpp"

#include "pictures/scale_ticks.hpp"
#include "xraycast/base/image.hpp"
#include "xraycast/base/png_file.hpp"
#include "xraycast/scene/canvas.hpp"

#include <fmt/format.h>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace xraycast::cli {
namespace {

constexpr int kFont = 13, kRight = 12;
constexpr Colour kPaper{0.11, 0.11, 0.11}, kInk{0.9, 0.9, 0.9};

std::uint8_t paper_grey() { return static_cast<std::uint8_t>(std::lround(255 * kPaper.red)); }

/// What the rows of a layer measure, row 0 on top.
struct RowScale {
  std::string unit;
  double first, per_row;  ///< at the middle of row 0, and from row to row

  double row_of(double value) const { return (value - first) / per_row; }
};

RowScale rows_of(const MapGeometry& geometry) {
  if (geometry.projection == Projection::sphere)
    return {"deg", glm::degrees(geometry.theta_rad(0)),
            glm::degrees(geometry.theta_rad(1) - geometry.theta_rad(0))};
  return {"z, mm", geometry.top_mm, -geometry.row_spacing_mm};
}

std::string title_of(const MapGeometry& geometry, int layer) {
  const int layers = geometry.layers();
  if (geometry.projection == Projection::rectangle)
    return fmt::format("view {} of {}: {:.1f} deg", layer + 1, layers,
                       glm::degrees(geometry.view_rad(layer)));
  const auto edge_mm = [&](int k) { return geometry.radii_mm[static_cast<std::size_t>(k)]; };
  return fmt::format("layer {} of {}: {:.1f} to {:.1f} mm{}", layer + 1, layers, edge_mm(layer),
                     edge_mm(layer + 1), geometry.has_outline() ? " at the widest" : "");
}

/// 8-bit RGB of a size that a canvas need not have.
struct Strip {
  int width, height;
  std::vector<std::uint8_t> rgb;

  void paste(const Strip& other, int left, int top) {
    for (int y = 0; y < other.height; ++y)
      std::copy_n(other.rgb.begin() + std::ptrdiff_t{3} * other.width * y, std::ptrdiff_t{3} * other.width,
                  rgb.begin() + std::ptrdiff_t{3} * (std::ptrdiff_t{width} * (top + y) + left));
  }
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

/// A layer's greys below its title and beside the scale.
Strip tile_of(const MapGeometry& geometry, int layer, std::span<const std::uint8_t> greys, const Strip& scale,
              int width) {
  Strip tile = title(geometry, layer, width);
  tile.height += geometry.height;
  tile.rgb.resize(std::size_t{3} * width * tile.height, paper_grey());
  tile.paste(scale, 0, kPreviewTitle);
  tile.paste({geometry.width, geometry.height, rgb_of(greys)}, kPreviewLeft, kPreviewTitle);
  return tile;
}

/// Layers in a column: all where they fit onto a screen, else so many that the picture's longer side is
/// least.
int rows_of_grid(int layers, int tile_width, int tile_height) {
  constexpr int kScreen = 2000;
  if (layers * tile_height <= kScreen) return layers;
  const auto longer_side = [&](int rows) {
    return std::max((layers + rows - 1) / rows * tile_width, rows * tile_height);
  };
  int best = layers;
  for (int rows = layers - 1; rows > 0; --rows)
    if (longer_side(rows) < longer_side(best)) best = rows;
  return best;
}

}  // namespace

void write_map_preview(const BodyMap& map, PreviewWindow window, const std::filesystem::path& path) {
  const MapGeometry& geometry = map.geometry;
  const std::vector<std::uint8_t> greys = preview_of(map, window);
  const Strip scale = scale_of(geometry);
  const int width = width_of(geometry), height = kPreviewTitle + geometry.height, layers = geometry.layers();
  const int rows = rows_of_grid(layers, width, height), columns = (layers + rows - 1) / rows;
  Strip picture{columns * width, rows * height, {}};
  picture.rgb.resize(std::size_t{3} * picture.width * picture.height, paper_grey());
  for (int k = 0; k < layers; ++k) {
    const auto layer =
        std::span(greys).subspan(static_cast<std::size_t>(k) * map.layer_size(), map.layer_size());
    picture.paste(tile_of(geometry, k, layer, scale, width), k / rows * width, k % rows * height);
  }
  write_png(picture.rgb, picture.width, picture.height, 3, path);
}

}  // namespace xraycast::cli
