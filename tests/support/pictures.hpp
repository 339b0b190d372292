#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace xraycast {

/// A PNG's 8-bit values as they are stored, row 0 on top, channels interleaved.
struct Png {
  int width, height, channels;
  std::vector<std::uint8_t> values;
};

/// Throws std::runtime_error when libpng cannot read it.
Png read_png(const std::filesystem::path& path);

/// A channel of the first part, by OpenEXR's C++ library, where ours reads by its C library. Throws Iex's
/// exceptions.
std::vector<float> read_exr(const std::filesystem::path& path, const std::string& channel);

}  // namespace xraycast
