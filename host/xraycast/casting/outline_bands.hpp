#pragma once

#include "xraycast/casting/map_geometry.hpp"

#include <vector>

namespace xraycast {

/// Consecutive rows of a map that share an outline.
struct OutlineBand {
  int first_row = 0, rows = 0;
  bool operator==(const OutlineBand&) const = default;
};

/// The bands of a map, from row 0 on: one where all rows have the same outline, or circles.
std::vector<OutlineBand> outline_bands(const MapGeometry& geometry);

/// At most so many bands are drawn by columns (see has_columns), and made by fit_to_body.
inline constexpr int kMostOutlineBands = 8;

}  // namespace xraycast
