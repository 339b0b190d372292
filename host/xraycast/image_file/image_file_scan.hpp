#pragma once

#include "xraycast/volume/scan_info.hpp"

#include <filesystem>
#include <string>

namespace xraycast {

/// One file (or header with a data file beside it) that holds a whole volume.
Scan open_nifti(const std::filesystem::path& path, const ScanOptions& options, Progress& progress);
Scan open_nrrd(const std::filesystem::path& path, const ScanOptions& options, Progress& progress);
Scan open_meta_image(const std::filesystem::path& path, const ScanOptions& options, Progress& progress);

/// Whether a file's first bytes are MetaImage header lines; the format has no magic number.
bool is_meta_image(const std::string& leading_bytes);

}  // namespace xraycast
