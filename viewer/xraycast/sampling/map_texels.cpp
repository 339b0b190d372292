#include "xraycast/sampling/map_texels.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/casting/outline_bands.hpp"
#include "xraycast/kernels/params.h"
#include "xraycast/sampling/shell_halves.hpp"

#include <glm/gtc/packing.hpp>

#include <algorithm>
#include <cassert>
#include <cstring>
#include <optional>
#include <vector>

namespace xraycast {
namespace {

/// From the optical depths of a map's shells to the values of the drawn ones, a row of texels at a time.
class RowSolver {
 public:
  RowSolver(const MapGeometry& geometry, const SampleOptions& options)
      : geometry_(geometry),
        solves_(geometry.ray_layout != RayLayout::rectangle && options.compositing == Compositing::path),
        profile_(drawn_shells(geometry, options).radii_mm, options.reconstruction) {
    if (options.blends_layers(geometry)) halves_.emplace(geometry.radii_mm);
    // About a straight axis all rows of a band are alike.
    if (solves_ && geometry.ray_layout == RayLayout::cylinder && has_columns(geometry))
      for (const OutlineBand& band : outline_bands(geometry)) {
        last_rows_.push_back(band.first_row + band.rows - 1);
        common_.push_back(system_of(band.first_row));
      }
  }

  /// Drawn shells to one of the map's.
  std::size_t parts() const { return halves_ ? 2 : 1; }

  /// From K x width to layers of that many texels, `stride` apart. Along rays that an outline shortens, mu is
  /// solved for over the lengths of the longest.
  void solve(int row, std::span<float> shells, std::span<float> drawn, std::size_t stride) const {
    const auto layers = static_cast<std::size_t>(geometry_.layers()),
               width = static_cast<std::size_t>(geometry_.width);
    if (solves_ && geometry_.has_outline())
      for (std::size_t i = 0; i < width; ++i) {
        const auto longer = static_cast<float>(1 / geometry_.scale(static_cast<int>(i), row));
        for (std::size_t k = 0; k < layers; ++k) shells[k * width + i] *= longer;
      }
    const System own = solves_ && common_.empty() ? system_of(row) : System();
    const System& system =
        common_.empty() ? own : common_[std::ranges::lower_bound(last_rows_, row) - last_rows_.begin()];
    if (halves_)
      system.split.halve(shells, drawn, stride);
    else
      for (std::size_t k = 0; k < layers; ++k) std::copy_n(&shells[k * width], width, &drawn[k * stride]);
    if (solves_) system.profile.solve(drawn, stride);
  }

 private:
  struct System {
    ShellHalves::Split split;
    RadialProfile::System profile;
  };

  System system_of(int row) const {
    std::vector<double> reaches_mm;
    for (int i = 0; i < geometry_.width; ++i) reaches_mm.push_back(geometry_.reach_mm(i, row));
    return {halves_ ? halves_->split(reaches_mm) : ShellHalves::Split(), profile_.system(reaches_mm)};
  }

  const MapGeometry& geometry_;
  bool solves_;
  RadialProfile profile_;
  std::optional<ShellHalves> halves_;
  std::vector<int> last_rows_;  ///< of bands of rows that are alike
  std::vector<System> common_;  ///< of each
};

}  // namespace

MapGeometry drawn_geometry(const BodyMap& map) {
  MapGeometry geometry = map.geometry;
  if (!map.spectrum() && map.opacity().mu_per_mm(XRC_PADDING_HU) > 0) geometry.field.reset();
  return geometry;
}

MapTexels texels_of(const MapGeometry& drawn) {
  return {drawn.layers(), drawn.width + 1, (drawn.height + 3) / 4};
}

void make_texels(const MapGeometry& geometry, std::span<const float> values, const SampleOptions& options,
                 std::span<const float> layer_weights, std::span<float> texels) {
  const auto width = static_cast<std::size_t>(geometry.width),
             height = static_cast<std::size_t>(geometry.height),
             shells = static_cast<std::size_t>(geometry.layers());
  const RowSolver solver(geometry, options);
  const MapTexels layout = texels_of(drawn_shells(geometry, options));
  const auto layers = static_cast<std::size_t>(layout.layers), run = std::size_t{4} * layout.quads;
  assert(texels.size() == layout.values());

  // Blocks of rows that fit the cache: each is solved along the layers, then transposed.
  constexpr std::size_t kRows = 16;
  parallel_for(static_cast<std::int64_t>((height + kRows - 1) / kRows), [&](std::int64_t block) {
    const std::size_t first = static_cast<std::size_t>(block) * kRows, rows = std::min(kRows, height - first);
    const std::size_t stride = rows * width;
    std::vector<float> drawn(layers * stride), row(shells * width);
    for (std::size_t j = 0; j < rows; ++j) {
      for (std::size_t k = 0; k < shells; ++k)
        std::copy_n(&values[(k * height + first + j) * width], width, &row[k * width]);
      solver.solve(static_cast<int>(first + j), row, std::span(drawn).subspan(j * width), stride);
    }
    for (std::size_t k = 0; k < layers; ++k) {
      const float weight = layer_weights.empty() ? 1.0f : layer_weights[k / solver.parts()];
      for (std::size_t i = 0; i <= width; ++i) {
        float* to = &texels[(k * (width + 1) + i) * run + first];
        const float* from = &drawn[k * stride + i % width];
        for (std::size_t j = 0; j < rows; ++j) to[j] = weight * from[j * width];
        std::fill(to + rows, to + std::min(kRows, run - first), weight * from[(rows - 1) * width]);
      }
    }
  });
}

PackedTexels pack_texels(const MapTexels& layout, std::span<const float> texels, MapPrecision precision) {
  assert(precision != MapPrecision::float32 && texels.size() == layout.values());
  const bool is_half = precision == MapPrecision::float16;
  const std::size_t value_B = is_half ? sizeof(glm::uint16) : 1;
  const auto of_layer = static_cast<std::size_t>(4) * layout.layer_stride();
  PackedTexels packed;
  packed.values.resize(texels.size() * value_B);
  if (!is_half) packed.byte_ranges.resize(static_cast<std::size_t>(layout.layers));
  parallel_for(layout.layers, [&](std::int64_t layer) {
    const std::size_t first = static_cast<std::size_t>(layer) * of_layer;
    const std::span<const float> from = texels.subspan(first, of_layer);
    std::byte* to = &packed.values[first * value_B];
    if (is_half) {
      for (std::size_t i = 0; i < of_layer; ++i) {
        const glm::uint16 half = glm::packHalf1x16(std::clamp(from[i], -kLargestHalf, kLargestHalf));
        std::memcpy(to + i * value_B, &half, value_B);
      }
      return;
    }
    const LayerByteRange range = packed.byte_ranges[static_cast<std::size_t>(layer)] = byte_range_of(from);
    for (std::size_t i = 0; i < of_layer; ++i) to[i] = std::byte{range.byte_of(from[i])};
  });
  return packed;
}

}  // namespace xraycast
