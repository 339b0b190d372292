#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace xraycast {

using Rgb = std::array<std::uint8_t, 3>;

/// A picture of at most 256 colours: for each pixel the number of its colour.
struct IndexedPicture {
  std::vector<Rgb> palette;
  std::vector<std::uint8_t> indices;
};

/// The colours of an 8-bit RGB picture reduced to 256 by median cut (Heckbert 1982); a picture with no more
/// colours keeps its own.
IndexedPicture with_palette(std::span<const std::uint8_t> rgb);

}  // namespace xraycast
