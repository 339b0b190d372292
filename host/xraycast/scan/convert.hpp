#pragma once

#include "xraycast/base/dicom_patient.hpp"
#include "xraycast/motion/motion_request.hpp"
#include "xraycast/scan/scan.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace xraycast {

/// A scan to be written in another format.
struct ConvertRequest {
  std::filesystem::path input{};
  std::filesystem::path output{};  ///< a new folder for a DICOM CT series, or a file (see write_volume)
  ScanOptions scan{};
  DicomPatient patient{};  ///< of a DICOM series
  MotionRequest motion{};  ///< of the scan, which is written as it is at that instant
};

/// Throws InputError for a format that there is not, a patient of what is not DICOM, and a file that cannot
/// be written.
void check(const ConvertRequest& request);

/// What was converted.
struct Converted {
  VolumeGeometry geometry;
  ScanInfo info;                              ///< of the input
  std::vector<std::string> voxel_warnings{};  ///< SliceSource::HuRange::warnings() of the input
  bool is_series = false;
  std::string frame_of_reference_uid{};  ///< of the series, that of the input; empty: a new one
  MotionOfRequest motion{};              ///< at which instant
};

/// Reads the input and writes the output. Throws InputError as check(), open_scan and write_ct_series do.
Converted convert(const ConvertRequest& request, Progress& progress);

}  // namespace xraycast
