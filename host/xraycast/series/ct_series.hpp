#pragma once

#include "xraycast/base/dicom_patient.hpp"
#include "xraycast/base/progress.hpp"
#include "xraycast/volume/volume.hpp"

#include <filesystem>
#include <string>

namespace xraycast {

/// Whether an output's name means a DICOM folder: it is an existing folder or has no extension.
bool is_ct_series(const std::filesystem::path& path);

/// What a series was made from.
struct CtSeriesSource {
  std::string name;                      ///< for the Derivation Description
  std::string frame_of_reference_uid{};  ///< that the volume lies in; empty: a new one
};

/// Writes a volume as a DICOM series of CT Image Storage, one file per slice from the most inferior, of
/// uncompressed int16 HU, in a new study. The folder appears when it is complete; a stage "writing" of
/// `progress` counts slices.
///
/// Throws InputError when the folder exists and is not empty, cannot be made, a slice has more than 65,535
/// rows or columns or takes more than 4 GiB, or the patient's name or ID is invalid; Error when the disk is
/// full.
void write_ct_series(const Volume& volume, const std::filesystem::path& folder, const DicomPatient& patient,
                     const CtSeriesSource& source, Progress& progress);

/// Throws what write_ct_series would throw, before the volume is read.
void check_ct_series(const VolumeGeometry& geometry, const std::filesystem::path& folder,
                     const DicomPatient& patient);

}  // namespace xraycast
