#pragma once

#include "xraycast/series/dicom_slice.hpp"
#include "xraycast/volume/scan_info.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace xraycast {

/// The greyscale images of one series.
struct DicomSeries {
  std::vector<DicomFileSummary> files;  ///< at least one
  bool is_ct = false;                   ///< CT slices; otherwise whatever else has the same UID
};

/// The series that `wanted` names (by number, part of the description or of the UID), or without a name the
/// best CT series, or the largest one where there is no CT. Reports the choice in `info`: `series`,
/// `other_series`, `all_series`, notes and warnings. Throws InputError when no series or several match;
/// `path` is for messages.
DicomSeries choose_series(std::vector<DicomFileSummary> files, const std::string& wanted,
                          const std::filesystem::path& path, ScanInfo& info);

}  // namespace xraycast
