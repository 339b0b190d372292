#include "xraycast/export/packed_layers.hpp"

#include "xraycast/base/parallel.hpp"

#include <glm/gtc/packing.hpp>

#include <algorithm>
#include <cassert>
#include <cstdint>

namespace xraycast {
namespace {

/// What the values to the left, above, and above to the left predict.
int predicted(int left, int above, int corner) {
  const auto [low, high] = std::minmax(left, above);
  if (corner >= high) return low;
  if (corner <= low) return high;
  return left + above - corner;
}

/// Calls `use(i, difference)` with the difference of every value of a picture from what its neighbours
/// predict.
template <typename Value, typename Use>
void for_each_difference(std::span<const Value> values, int width, const Use& use) {
  const auto row = static_cast<std::size_t>(width);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const bool is_first = i % row == 0, is_top = i < row;
    const int left = !is_first ? values[i - 1] : is_top ? 0 : values[i - row];
    const int above = is_top ? left : values[i - row];
    const int corner = is_first || is_top ? above : values[i - row - 1];
    use(i, values[i] - predicted(left, above, corner));
  }
}

void pack_bytes(std::span<const std::uint8_t> bytes, int width, char* to) {
  for_each_difference<std::uint8_t>(bytes, width, [&](std::size_t i, int difference) {
    to[i] = static_cast<char>(static_cast<std::uint8_t>(difference));
  });
}

void pack_halves(std::span<const float> tau, int width, char* to) {
  std::vector<std::uint16_t> halves(tau.size());
  std::ranges::transform(tau, halves.begin(), [](float value) {
    return glm::packHalf1x16(std::clamp(value, -kLargestHalf, kLargestHalf));
  });
  for_each_difference<std::uint16_t>(halves, width, [&](std::size_t i, int difference) {
    const auto wrapped = static_cast<std::int16_t>(static_cast<std::uint16_t>(difference));
    const auto coded =
        static_cast<std::uint16_t>((static_cast<std::uint16_t>(wrapped) << 1) ^ (wrapped < 0 ? 0xffff : 0));
    to[i] = static_cast<char>(coded & 255);
    to[tau.size() + i] = static_cast<char>(coded >> 8);
  });
}

/// See pack_keys.
int key_before(const KeyPhases& phases, int key) {
  int stride = 1;
  for (std::size_t m = phases.phases().size(); m-- > 0;) {
    const auto size = static_cast<int>(phases.phases()[m].size());
    if (key / stride % size > 0) return key - stride;
    stride *= size;
  }
  return -1;
}

/// A row of a layer of a key map.
std::span<const std::uint8_t> row_of(const KeyMaps& maps, int width, int key, int layer, int row) {
  const KeyMaps::Key& owner = maps.keys()[static_cast<std::size_t>(maps.owner_of(key, row))];
  const auto first = static_cast<std::size_t>(layer * owner.rows.count + row - owner.rows.first) *
                     static_cast<std::size_t>(width);
  return std::span(owner.channels.front()).subspan(first, static_cast<std::size_t>(width));
}

/// The same rows, and as many more as it takes for whole quads.
KeyRows in_quads(const KeyRows& rows, int height) {
  const int first = rows.first / 4 * 4, end = std::min(height, (rows.first + rows.count + 3) / 4 * 4);
  return {rows.base, first, rows.count > 0 ? end - first : 0};
}

}  // namespace

PackedKeys pack_keys(const KeyMaps& maps, const MapGeometry& geometry) {
  const int width = geometry.width, height = geometry.height, layers = geometry.layers();
  const std::size_t area = static_cast<std::size_t>(width) * height;
  PackedKeys packed;
  packed.first.byte_ranges = maps.ranges().front();
  packed.first.bytes.resize(static_cast<std::size_t>(layers) * area);
  const std::span<const std::uint8_t> first = maps.keys().front().channels.front();
  for (int k = 0; k < layers; ++k) {
    const std::size_t at = static_cast<std::size_t>(k) * area;
    pack_bytes(first.subspan(at, area), width, &packed.first.bytes[at]);
  }
  packed.rows.push_back({-1, 0, height});
  for (int key = 1; key < std::ssize(maps.keys()); ++key) {
    const KeyRows rows =
        packed.rows.emplace_back(in_quads(maps.keys()[static_cast<std::size_t>(key)].rows, height));
    const int before = key_before(maps.phases(), key);
    for (int k = 0; k < layers; ++k)
      for (int row = rows.first; row < rows.first + rows.count; ++row) {
        const auto here = row_of(maps, width, key, k, row), there = row_of(maps, width, before, k, row);
        for (std::size_t i = 0; i < here.size(); ++i)
          packed.others += static_cast<char>(static_cast<std::uint8_t>(here[i] - there[i]));
      }
  }
  return packed;
}

PackedLayers pack_layers(const BodyMap& map, MapPrecision precision) {
  assert(precision != MapPrecision::float32 && !map.spectrum());
  const bool is_half = precision == MapPrecision::float16;
  const auto layers = static_cast<std::size_t>(map.geometry.layers());
  const std::size_t layer_B = map.layer_size() * (is_half ? 2 : 1);
  PackedLayers packed;
  packed.bytes.resize(layers * layer_B);
  if (!is_half) packed.byte_ranges.resize(layers);
  parallel_for(map.geometry.layers(), [&](std::int64_t k) {
    const auto tau = map.layer(static_cast<int>(k));
    char* to = &packed.bytes[static_cast<std::size_t>(k) * layer_B];
    if (is_half) return pack_halves(tau, map.geometry.width, to);
    const LayerByteRange range = packed.byte_ranges[static_cast<std::size_t>(k)] = byte_range_of(tau);
    std::vector<std::uint8_t> bytes(tau.size());
    std::ranges::transform(tau, bytes.begin(), [&](float value) { return range.byte_of(value); });
    pack_bytes(bytes, map.geometry.width, to);
  });
  return packed;
}

}  // namespace xraycast
