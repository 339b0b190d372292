#pragma once

#include "xraycast/scan/scan.hpp"

#include <filesystem>
#include <vector>

namespace xraycast {

/// Opens one series of the DICOM files among `files`; those that are DICOM but hold no image are passed over.
/// `path` is what the user gave, for messages.
Scan open_dicom(const std::filesystem::path& path, const std::vector<std::filesystem::path>& files,
                const ScanOptions& options, Progress& progress);

}  // namespace xraycast
