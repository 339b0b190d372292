#pragma once

#include "xraycast/centrelines/centreline_file.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <array>
#include <string>
#include <vector>

namespace xraycast {

/// Lines as one graph: points, and edges between them, each once.
struct JoinedLines {
  std::vector<VesselPoint> points;
  std::vector<std::array<int, 2>> edges;
  std::vector<int> starts;  ///< the point where each line starts that has two points or more
  std::vector<int> roots;   ///< those of lines with parents that have none themselves
  int doubled_points = 0;   ///< that coincided with the one before
  int short_lines = 0;      ///< of fewer than two points
};

/// Joins lines as tree_of_lines says. Throws InputError, with `name` in front.
JoinedLines joined_lines(const std::vector<CentrelineLine>& lines, const std::string& name);

}  // namespace xraycast
