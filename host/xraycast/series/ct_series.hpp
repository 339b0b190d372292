#pragma once

#include "xraycast/base/dicom_patient.hpp"
#include "xraycast/base/progress.hpp"
#include "xraycast/volume/volume.hpp"

#include <filesystem>
#include <string>

namespace xraycast {

/// Whether an output's name is that of a series' folder: it exists as one, or has no extension.
bool is_ct_series(const std::filesystem::path& path);

/// Writes a volume as a DICOM series of CT Image Storage, one file a slice from the most inferior, of
/// uncompressed int16 HU, in a study of its own. `source` is what the Derivation Description names. The
/// folder appears when all of it is written; a stage "writing" of `progress` counts slices.
///
/// Throws InputError when the folder exists and is not empty, cannot be made, a slice has more than 65,535
/// rows or columns, or the patient does not fit; Error when the disk is full.
void write_ct_series(const Volume& volume, const std::filesystem::path& folder, const DicomPatient& patient,
                     const std::string& source, Progress& progress);

/// What write_ct_series refuses, before the volume is there.
void check_ct_series(const VolumeGeometry& geometry, const std::filesystem::path& folder,
                     const DicomPatient& patient);

}  // namespace xraycast
