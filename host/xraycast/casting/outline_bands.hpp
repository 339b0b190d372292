#pragma once

#include "xraycast/casting/map_geometry.hpp"

#include <string>
#include <vector>

namespace xraycast {

/// Consecutive rows of a map that share an outline.
struct OutlineBand {
  int first_row = 0, rows = 0;
  bool operator==(const OutlineBand&) const = default;
};

/// The bands of a map, from row 0 on: one where all rows have the same outline, or circles.
std::vector<OutlineBand> outline_bands(const MapGeometry& geometry);

/// Throws InputError, with `name` in front, where the outline of a whole map, as a file has it, reaches less
/// far than its shells: that of a map's narrower rows may.
void check_reach(const MapGeometry& geometry, const std::string& name);

/// At most so many bands are drawn by columns (see has_columns), and made by fit_to_body.
inline constexpr int kMostOutlineBands = 8;

}  // namespace xraycast
