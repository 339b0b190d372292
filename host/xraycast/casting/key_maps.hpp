#pragma once

#include "xraycast/casting/body_map.hpp"
#include "xraycast/motion/key_phases.hpp"

#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// Where the texels of a key map are: its own rows here, all others in the key map `base`, which comes before
/// it. Key 0 owns all rows.
struct KeyRows {
  int base = -1;
  int first = 0, count = 0;

  bool owns(int row) const { return row >= first && row < first + count; }
};

/// A key map's own rows in floats: of each channel K x rows x W.
struct KeyValues {
  KeyRows rows{};
  std::vector<std::vector<float>> channels{};
};

/// These rows of a channel of a map, K x rows x W of K x H x W.
std::vector<float> own_rows(std::span<const float> whole, const MapGeometry& geometry, const KeyRows& rows);

/// The maps of a moving body at the keys of its motion, as bytes: of one geometry, and of each channel and
/// layer with one range of values, so that the map of any instant is a weighted sum of their bytes.
class KeyMaps {
 public:
  struct Key {
    KeyRows rows{};
    std::vector<std::vector<std::uint8_t>> channels{};  ///< as in KeyValues
  };

  /// One for each of the phases' keys, in order. The ranges reach from the least to the largest value.
  KeyMaps(KeyPhases phases, const MapGeometry& geometry, std::span<const KeyValues> values);
  /// As they were stored; `ranges` of each channel and layer.
  KeyMaps(KeyPhases phases, const MapGeometry& geometry, std::vector<Key> keys,
          std::vector<std::vector<LayerByteRange>> ranges);

  const KeyPhases& phases() const { return phases_; }
  const std::vector<Key>& keys() const { return keys_; }
  const std::vector<std::vector<LayerByteRange>>& ranges() const { return ranges_; }
  std::size_t size_B() const;  ///< of all bytes

  /// The key map that has a row of this one.
  int owner_of(int key, int row) const;

  /// Rows [first, end) of which the maps' weighted sum is that of the same few own rows.
  struct Band {
    int first, end;
    std::vector<KeyPhases::Share> shares;  ///< of keys that own these rows
  };
  /// From the top to the bottom.
  std::vector<Band> bands_at(std::span<const double> phases) const;

  /// The values of a channel at an instant, one phase a mode: K x H x W.
  std::vector<float> values_at(std::size_t channel, std::span<const double> phases) const;

  /// The motion's file, `motion.json`, where that is known: see write_body_map.
  std::filesystem::path motion{};

 private:
  KeyPhases phases_;
  int width_, height_, layers_;
  std::vector<Key> keys_;
  std::vector<std::vector<LayerByteRange>> ranges_;
};

/// The map with these keys, and with their values at phase 0 of all modes.
BodyMap moving_map(BodyMap map, std::shared_ptr<const KeyMaps> keys);

/// The map of a moving body at an instant, one phase a mode, as one that stands still; of a body that does
/// not move, the map itself.
BodyMap map_at(const BodyMap& map, std::span<const double> phases);

/// The same with fewer keys: so many phases of each mode that is named, evenly chosen from those that there
/// are, the first among them. Throws InputError, with the field `keys`, for a name that is no mode, and
/// unless it is two to as many as the mode has.
BodyMap with_fewer_keys(const BodyMap& map, const std::map<std::string, int>& keys);

/// `, breath 1, heart 0.4`, as in the sources of maps of an instant.
std::string instant_suffix(const KeyPhases& phases, std::span<const double> instant);

}  // namespace xraycast
