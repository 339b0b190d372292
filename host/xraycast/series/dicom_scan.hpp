#pragma once

#include "xraycast/volume/scan_info.hpp"

#include <filesystem>
#include <vector>

namespace xraycast {

/// Opens one series of the DICOM files `files`, selected by choose_series(); the others are skipped. `path`
/// is the user's path, for messages.
Scan open_dicom(const std::filesystem::path& path, const std::vector<std::filesystem::path>& files,
                const ScanOptions& options, Progress& progress);

/// Whether a DICOM file is a DICOMDIR, the table of contents of a CD.
bool is_dicom_directory(const std::filesystem::path& file);

}  // namespace xraycast
