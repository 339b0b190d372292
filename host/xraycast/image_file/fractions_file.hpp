#pragma once

#include "xraycast/volume/volume.hpp"

#include <cstdint>
#include <filesystem>
#include <vector>

namespace xraycast {

/// Fractions on a grid, 255 for 1, x fastest.
struct Fractions {
  VolumeGeometry geometry;
  std::vector<std::uint8_t> values;
};

/// Reads what write_fractions writes. Throws InputError, naming the file, for any other file.
Fractions read_fractions(const std::filesystem::path& path);

}  // namespace xraycast
