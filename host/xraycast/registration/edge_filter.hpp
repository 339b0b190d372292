#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace xraycast {

/// The derivatives of a picture, height x width, along rows and columns: central differences of the picture
/// smoothed by a Gaussian of about one pixel. Edges repeat beyond the border.
struct Edges {
  std::vector<float> across, down;
};

Edges edges_of(std::span<const float> picture, int width, int height);

/// The transposed filter: of derivatives by edges, those by the picture's pixels.
std::vector<float> transposed_edges(const Edges& slopes, int width, int height);

/// Where the filter meets nothing but pixels of the mask (empty: all) within the picture.
std::vector<std::uint8_t> within_filter(std::span<const std::uint8_t> mask, int width, int height);

}  // namespace xraycast
