#pragma once

#include "xraycast/volume/scan_info.hpp"

#include <filesystem>
#include <vector>

namespace xraycast {

/// Opens a stack of GE Genesis slices, the format of the Visible Human CT: one big-endian file per slice,
/// each with its own pixel size and centre. `path` is the user's path, for messages.
Scan open_genesis(const std::filesystem::path& path, const std::vector<std::filesystem::path>& files,
                  const ScanOptions& options, Progress& progress);

}  // namespace xraycast
