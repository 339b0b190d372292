#include "xraycast/sampling/key_texels.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/base/wide_vectors.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>

namespace xraycast {
namespace {

/// These rows of a map.
MapGeometry part_of(const MapGeometry& whole, const KeyRows& rows) {
  MapGeometry part = whole;
  part.height = rows.count;
  if (whole.ray_layout == RayLayout::cylinder) part.top_mm = whole.z_mm(rows.first);
  if (whole.centre_mm.size() > 1)
    part.centre_mm.assign(whole.centre_mm.begin() + rows.first,
                          whole.centre_mm.begin() + rows.first + rows.count);
  if (!whole.has_plane_outline())
    part.outline_mm.assign(whole.outline_mm.begin() + std::ptrdiff_t{rows.first} * whole.width,
                           whole.outline_mm.begin() + std::ptrdiff_t{rows.first + rows.count} * whole.width);
  return part;
}

/// A source of texels, and its share in 1/256.
struct Source {
  const std::uint8_t* texels;
  std::uint16_t weight;
};

/// The sums of two and of four sources, whose shares sum up to 256.
XRAYCAST_WIDE_VECTORS
void sum_two(const Source& a, const Source& b, std::uint8_t* sum, std::size_t count) {
  const std::uint8_t *pa = a.texels, *pb = b.texels;
  const std::uint16_t wa = a.weight, wb = b.weight;
  for (std::size_t i = 0; i < count; ++i) {
    const auto value = static_cast<std::uint16_t>(wa * pa[i] + wb * pb[i] + 128);
    sum[i] = static_cast<std::uint8_t>(value >> 8);
  }
}

XRAYCAST_WIDE_VECTORS
void sum_four(const std::array<Source, 4>& of, std::uint8_t* sum, std::size_t count) {
  const std::uint8_t *pa = of[0].texels, *pb = of[1].texels, *pc = of[2].texels, *pd = of[3].texels;
  const std::uint16_t wa = of[0].weight, wb = of[1].weight, wc = of[2].weight, wd = of[3].weight;
  for (std::size_t i = 0; i < count; ++i) {
    const auto value = static_cast<std::uint16_t>(wa * pa[i] + wb * pb[i] + wc * pc[i] + wd * pd[i] + 128);
    sum[i] = static_cast<std::uint8_t>(value >> 8);
  }
}

void sum_many(std::span<const Source> of, std::uint8_t* sum, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    unsigned value = 128;
    for (const auto& [texels, weight] : of) value += unsigned{weight} * texels[i];
    sum[i] = static_cast<std::uint8_t>(value >> 8);
  }
}

void sum_up(std::span<const Source> of, std::uint8_t* sum, std::size_t count) {
  if (of.size() == 1)
    std::memcpy(sum, of[0].texels, count);
  else if (of.size() == 2)
    sum_two(of[0], of[1], sum, count);
  else if (of.size() <= 4)
    sum_four({of[0], of[1], of[2], of.size() == 4 ? of[3] : Source{of[0].texels, 0}}, sum, count);
  else
    sum_many(of, sum, count);
}

/// In 1/256, which sum up to 256; those that count less are left out.
std::vector<std::pair<int, std::uint16_t>> rounded(std::span<const KeyPhases::Share> shares) {
  std::vector<std::pair<int, std::uint16_t>> all;
  double sum = 0;
  long rounded_sum = 0;
  for (const auto& [key, weight] : shares) {
    const long next = std::lround(256 * (sum += weight));
    if (next > rounded_sum) all.emplace_back(key, static_cast<std::uint16_t>(next - rounded_sum));
    rounded_sum = next;
  }
  return all;
}

}  // namespace

KeyTexels::KeyTexels(const KeyMaps& maps, std::size_t channel, const MapGeometry& geometry,
                     const SampleOptions& options, std::span<const float> layer_weights)
    : layout_(texels_of(drawn_shells(geometry, options))), height_(geometry.height) {
  const auto layers = static_cast<std::size_t>(layout_.layers);
  /// Calls `take(layer, texels)` with the texels of every layer of a key map's own rows.
  const auto visit = [&](std::size_t k, const auto& take) {
    const KeyMaps::Key& key = maps.keys()[k];
    if (key.rows.count == 0) return;
    const MapGeometry part = part_of(geometry, key.rows);
    const std::size_t of_layer = key.channels[channel].size() / static_cast<std::size_t>(part.layers());
    std::vector<float> values(key.channels[channel].size());
    parallel_for(part.layers(), [&](std::int64_t layer) {
      const LayerByteRange& range = maps.ranges()[channel][layer];
      for (std::size_t i = layer * of_layer; i < (layer + 1) * of_layer; ++i)
        values[i] = range.value_of(key.channels[channel][i]);
    });
    const MapTexels layout = texels_of(drawn_shells(part, options));
    std::vector<float> texels(layout.values());
    make_texels(part, values, options, layer_weights, texels);
    const auto of_drawn = static_cast<std::size_t>(4) * layout.layer_stride();
    parallel_for(layout.layers, [&](std::int64_t layer) {
      take(static_cast<std::size_t>(layer),
           std::span<const float>(texels).subspan(layer * of_drawn, of_drawn));
    });
  };
  // The ranges first: all maps' texels as floats would take much memory.
  std::vector<std::pair<float, float>> extremes(
      layers, {std::numeric_limits<float>::max(), std::numeric_limits<float>::lowest()});
  for (std::size_t k = 0; k < maps.keys().size(); ++k)
    visit(k, [&](std::size_t layer, std::span<const float> texels) {
      const auto [least, largest] = std::ranges::minmax(texels);
      extremes[layer] = {std::min(extremes[layer].first, least), std::max(extremes[layer].second, largest)};
    });
  for (const auto& [least, largest] : extremes) byte_ranges_.push_back({least, (largest - least) / 255});
  for (std::size_t k = 0; k < maps.keys().size(); ++k) {
    Key& key = keys_.emplace_back(Key{maps.keys()[k].rows, {}});
    const auto rows = static_cast<std::size_t>(key.rows.count), run = (rows + 3) / 4 * 4,
               columns = static_cast<std::size_t>(layout_.columns);
    key.bytes.resize(layers * columns * rows);
    visit(k, [&](std::size_t layer, std::span<const float> texels) {
      for (std::size_t i = 0; i < columns; ++i)
        for (std::size_t j = 0; j < rows; ++j)
          key.bytes[(layer * columns + i) * rows + j] =
              std::byte{byte_ranges_[layer].byte_of(texels[i * run + j])};
    });
  }
}

std::size_t KeyTexels::size_B() const {
  std::size_t size = 0;
  for (const Key& key : keys_) size += key.bytes.size();
  return size;
}

void KeyTexels::blend(const KeyMaps& maps, std::span<const double> phases,
                      std::span<std::byte> texels) const {
  assert(texels.size() == layout_.values());
  struct Band {
    int first, end;
    std::vector<std::pair<int, std::uint16_t>> shares;
  };
  std::vector<Band> bands;
  for (const KeyMaps::Band& band : maps.bands_at(phases))
    bands.push_back({band.first, band.end, rounded(band.shares)});
  const auto run = static_cast<std::size_t>(4) * layout_.quads;
  auto* const all = reinterpret_cast<std::uint8_t*>(texels.data());
  parallel_for(layout_.layers, [&](std::int64_t layer) {
    std::vector<Source> sources;
    for (int column = 0; column < layout_.columns; ++column) {
      const std::int64_t at = layer * layout_.columns + column;
      std::uint8_t* to = all + static_cast<std::size_t>(at) * run;
      for (const Band& band : bands) {
        sources.clear();
        for (const auto& [number, weight] : band.shares) {
          const Key& key = keys_[static_cast<std::size_t>(number)];
          const auto* bytes = reinterpret_cast<const std::uint8_t*>(key.bytes.data());
          sources.push_back({bytes + at * key.rows.count + band.first - key.rows.first, weight});
        }
        sum_up(sources, to + band.first, static_cast<std::size_t>(band.end - band.first));
      }
      std::fill(to + height_, to + run, to[height_ - 1]);
    }
  });
}

}  // namespace xraycast
