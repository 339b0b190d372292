#pragma once

#include "xraycast/base/small_pictures.hpp"
#include "xraycast/casting/key_maps.hpp"

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// The path of a motion as a file of key maps has it, relative where it lies beside that, below, or beside a
/// folder above; and where that is.
std::string relative_motion(const std::filesystem::path& motion, const std::filesystem::path& file);
std::filesystem::path absolute_motion(const std::string& motion, const std::filesystem::path& file);

/// [[base, first, count], ...]
std::string key_rows_text(std::span<const KeyRows> rows);

/// Of so many keys of a map of so many rows. Throws InputError, with `name` in front.
std::vector<KeyRows> parse_key_rows(const std::string& text, int keys, int height, const std::string& name);

/// The layers of key maps as parts of a file, and the floats that these hold.
struct KeyParts {
  std::vector<ExrPart> parts{};
  std::vector<std::vector<float>> floats{};
};

/// Of a map with keys, whose channels have these names. The first part has the attributes `xraycast:keys`,
/// `key_rows` and `motion`, for a file of that path.
KeyParts key_parts(const BodyMap& map, const std::vector<std::string>& channels,
                   const std::filesystem::path& path);

/// Reads what key_parts made, and says how many parts these are. Throws InputError, naming the file and the
/// attribute or part.
KeyMaps read_keys(const ExrReader& file, const MapGeometry& geometry,
                  const std::vector<std::string>& channels, std::vector<std::vector<LayerByteRange>> ranges,
                  const std::filesystem::path& path, int& parts);

}  // namespace xraycast
