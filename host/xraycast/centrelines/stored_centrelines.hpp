#pragma once

#include "xraycast/centrelines/centreline_file.hpp"

#include <filesystem>
#include <vector>

namespace xraycast {

/// Centrelines as a file has them: in its unit, radii missing, or not above zero where they are unknown.
struct StoredCentrelines {
  std::vector<CentrelineLine> lines;
  bool is_lps = false;  ///< the file says its frame, and the points are LPS already
};

// The readers of read_centreline_lines, one a format.
StoredCentrelines read_polydata_lines(const std::filesystem::path& path);
StoredCentrelines read_markups(const std::filesystem::path& path);
StoredCentrelines read_swc(const std::filesystem::path& path);
StoredCentrelines read_centreline_csv(const std::filesystem::path& path);

}  // namespace xraycast
