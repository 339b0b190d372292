#include "xraycast/casting/key_maps.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <set>
#include <utility>

namespace xraycast {
namespace {

/// Of each layer, over all keys' own rows.
std::vector<LayerByteRange> ranges_of(std::span<const KeyValues> values, std::size_t channel, int layers) {
  std::vector<LayerByteRange> ranges;
  for (int layer = 0; layer < layers; ++layer) {
    float least = std::numeric_limits<float>::max(), largest = std::numeric_limits<float>::lowest();
    for (const KeyValues& key : values) {
      const std::vector<float>& all = key.channels[channel];
      const std::size_t of_layer = all.size() / static_cast<std::size_t>(layers);
      if (of_layer == 0) continue;
      const auto [lower, upper] = std::ranges::minmax(std::span(all).subspan(layer * of_layer, of_layer));
      least = std::min(least, lower);
      largest = std::max(largest, upper);
    }
    ranges.push_back({least, (largest - least) / 255});
  }
  return ranges;
}

std::vector<std::uint8_t> bytes_of(const std::vector<float>& values, std::span<const LayerByteRange> ranges) {
  std::vector<std::uint8_t> bytes(values.size());
  const std::size_t of_layer = values.size() / ranges.size();
  parallel_for(std::ssize(ranges), [&](std::int64_t layer) {
    const std::size_t first = static_cast<std::size_t>(layer) * of_layer;
    for (std::size_t i = first; i < first + of_layer; ++i) bytes[i] = ranges[layer].byte_of(values[i]);
  });
  return bytes;
}

/// Of each mode, which of its phases are kept.
std::vector<std::vector<std::size_t>> chosen_phases(const KeyPhases& all,
                                                    const std::map<std::string, int>& keys) {
  for (const auto& [mode, count] : keys)
    all.rhythm().number_of(mode, fmt::format("`keys` {}={}", excerpt(mode), count));
  std::vector<std::vector<std::size_t>> chosen;
  for (std::size_t m = 0; m < all.phases().size(); ++m) {
    const MotionMode& mode = all.rhythm().modes()[m];
    const int count = static_cast<int>(all.phases()[m].size());
    const auto given = keys.find(mode.name);
    const int fewer = given == keys.end() ? count : given->second;
    if (fewer < 2 || fewer > count)
      throw InputError("`keys` {}={}: must be 2 to {}, as many as the map has", mode.name, fewer, count);
    const double step = mode.wraps() ? double(count) / fewer : double(count - 1) / (fewer - 1);
    std::vector<std::size_t>& of_mode = chosen.emplace_back();
    for (int i = 0; i < fewer; ++i) of_mode.push_back(static_cast<std::size_t>(std::lround(i * step)));
  }
  return chosen;
}

}  // namespace

std::vector<float> own_rows(std::span<const float> whole, const MapGeometry& geometry, const KeyRows& rows) {
  const auto width = static_cast<std::size_t>(geometry.width);
  const std::size_t of_layer = width * static_cast<std::size_t>(rows.count);
  std::vector<float> own(of_layer * static_cast<std::size_t>(geometry.layers()));
  for (int k = 0; k < geometry.layers(); ++k)
    std::copy_n(&whole[(static_cast<std::size_t>(k) * geometry.height + rows.first) * width], of_layer,
                &own[k * of_layer]);
  return own;
}

KeyMaps::KeyMaps(KeyPhases phases, const MapGeometry& geometry, std::span<const KeyValues> values)
    : phases_(std::move(phases)),
      width_(geometry.width),
      height_(geometry.height),
      layers_(geometry.layers()) {
  for (std::size_t channel = 0; channel < values.front().channels.size(); ++channel)
    ranges_.push_back(ranges_of(values, channel, layers_));
  for (const KeyValues& one : values) {
    Key& key = keys_.emplace_back(Key{one.rows, {}});
    for (std::size_t channel = 0; channel < ranges_.size(); ++channel)
      key.channels.push_back(bytes_of(one.channels[channel], ranges_[channel]));
  }
}

KeyMaps::KeyMaps(KeyPhases phases, const MapGeometry& geometry, std::vector<Key> keys,
                 std::vector<std::vector<LayerByteRange>> ranges)
    : phases_(std::move(phases)),
      width_(geometry.width),
      height_(geometry.height),
      layers_(geometry.layers()),
      keys_(std::move(keys)),
      ranges_(std::move(ranges)) {}

std::size_t KeyMaps::size_B() const {
  std::size_t size = 0;
  for (const Key& key : keys_)
    for (const auto& channel : key.channels) size += channel.size();
  return size;
}

int KeyMaps::owner_of(int key, int row) const {
  while (!keys_[static_cast<std::size_t>(key)].rows.owns(row))
    key = keys_[static_cast<std::size_t>(key)].rows.base;
  return key;
}

std::vector<KeyMaps::Band> KeyMaps::bands_at(std::span<const double> phases) const {
  const std::vector<KeyPhases::Share> shares = phases_.shares_at(phases);
  std::set<int> edges{0, height_};
  for (const auto& [nearest, weight] : shares)
    for (int key = nearest; key > 0; key = keys_[static_cast<std::size_t>(key)].rows.base) {
      const KeyRows& rows = keys_[static_cast<std::size_t>(key)].rows;
      edges.insert({rows.first, rows.first + rows.count});
    }
  std::vector<Band> bands;
  for (auto edge = edges.begin(); std::next(edge) != edges.end(); ++edge) {
    Band& band = bands.emplace_back(Band{*edge, *std::next(edge), {}});
    for (const auto& [nearest, weight] : shares) {
      const int key = owner_of(nearest, band.first);
      const auto known = std::ranges::find(band.shares, key, &KeyPhases::Share::key);
      if (known == band.shares.end())
        band.shares.push_back({key, weight});
      else
        known->weight += weight;
    }
  }
  return bands;
}

std::vector<float> KeyMaps::values_at(std::size_t channel, std::span<const double> phases) const {
  std::vector<float> values(static_cast<std::size_t>(layers_) * height_ * width_);
  const std::vector<Band> bands = bands_at(phases);
  parallel_for(layers_, [&](std::int64_t layer) {
    const LayerByteRange& range = ranges_[channel][static_cast<std::size_t>(layer)];
    for (const Band& band : bands)
      for (int row = band.first; row < band.end; ++row) {
        float* to = &values[static_cast<std::size_t>(layer * height_ + row) * width_];
        for (const auto& [number, weight] : band.shares) {
          const Key& key = keys_[static_cast<std::size_t>(number)];
          const std::uint8_t* from =
              &key.channels[channel]
                           [static_cast<std::size_t>(layer * key.rows.count + row - key.rows.first) * width_];
          const auto share = static_cast<float>(weight);
          for (int i = 0; i < width_; ++i) to[i] += share * from[i];
        }
        for (int i = 0; i < width_; ++i) to[i] = range.value_of(to[i]);
      }
  });
  return values;
}

BodyMap moving_map(BodyMap map, std::shared_ptr<const KeyMaps> keys) {
  map.precision = MapPrecision::byte;
  map.keys = std::move(keys);
  BodyMap at_rest = map_at(map, std::vector<double>(map.keys->phases().phases().size(), 0.0));
  map.tau = std::move(at_rest.tau);
  map.depths = std::move(at_rest.depths);
  return map;
}

BodyMap map_at(const BodyMap& map, std::span<const double> phases) {
  if (!map.keys) return map;
  BodyMap still;
  still.geometry = map.geometry;
  still.attenuation = map.attenuation;
  still.source = map.source + instant_suffix(map.keys->phases(), phases);
  still.frame_of_reference_uid = map.frame_of_reference_uid;
  still.precision = map.precision;
  if (map.spectrum())
    for (std::size_t m = 0; m < still.depths.size(); ++m) still.depths[m] = map.keys->values_at(m, phases);
  else
    still.tau = map.keys->values_at(0, phases);
  return still;
}

BodyMap with_fewer_keys(const BodyMap& map, const std::map<std::string, int>& keys) {
  const KeyPhases& all = map.keys->phases();
  const std::vector<std::vector<std::size_t>> chosen = chosen_phases(all, keys);
  std::vector<std::vector<double>> phases;
  for (std::size_t m = 0; m < chosen.size(); ++m) {
    std::vector<double>& of_mode = phases.emplace_back();
    for (const std::size_t i : chosen[m]) of_mode.push_back(all.phases()[m][i]);
  }
  KeyPhases fewer(all.rhythm(), std::move(phases));
  std::map<int, int> number_of;  // of a key of the map, among the fewer ones
  for (int key = 0; key < fewer.count(); ++key) {
    int old = 0, rest = key, stride = fewer.count();
    for (std::size_t m = 0; m < chosen.size(); ++m) {
      stride /= static_cast<int>(chosen[m].size());
      old = old * static_cast<int>(all.phases()[m].size()) +
            static_cast<int>(chosen[m][static_cast<std::size_t>(rest / stride)]);
      rest %= stride;
    }
    number_of[old] = key;
  }
  std::vector<KeyMaps::Key> kept;
  for (const auto& [old, key] : number_of) {
    KeyMaps::Key& one = kept.emplace_back(map.keys->keys()[static_cast<std::size_t>(old)]);
    if (one.rows.base < 0) continue;
    const auto base = number_of.find(one.rows.base);
    if (base == number_of.end())
      throw InputError("`keys`: those of {} do not go without each other; leave it out", map.source);
    one.rows.base = base->second;
  }
  auto maps = std::make_shared<KeyMaps>(std::move(fewer), map.geometry, std::move(kept), map.keys->ranges());
  maps->motion = map.keys->motion;
  BodyMap result = map;
  result.keys = std::move(maps);
  return result;
}

std::string instant_suffix(const KeyPhases& phases, std::span<const double> instant) {
  std::string words;
  for (std::size_t m = 0; m < instant.size(); ++m)
    words += fmt::format(", {} {:.3g}", phases.rhythm().modes()[m].name, instant[m]);
  return words;
}

}  // namespace xraycast
