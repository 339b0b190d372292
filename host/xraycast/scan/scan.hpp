#pragma once

#include "xraycast/image_file/write_volume.hpp"
#include "xraycast/volume/scan_info.hpp"

#include <filesystem>

namespace xraycast {

/// Opens a folder of DICOM or GE Genesis slices, or a single DICOM, Genesis, NIfTI, NRRD or MetaImage file.
/// Headers are read now (stage "opening"), voxels by the source.
///
/// A folder is searched with all its subfolders, such as those of a patient's CD, and so is that of a
/// DICOMDIR. The best CT series is chosen: the one with the most slices, then an axial one, then the
/// thinnest. Where there is no CT, other greyscale images are read instead.
///
/// The format is recognised by content, never by name alone. Slices are sorted by position along their
/// normal, rescaled to HU, clamped to [-1024, 32767] and delivered in the frame of VolumeGeometry. Stacks
/// that are sheared, uneven, or not aligned with the patient's axes are resampled onto a grid that is.
///
/// Throws InputError, naming the file and the field, and DamagedSlice for a slice that skip_damaged would
/// leave out.
Scan open_scan(const std::filesystem::path& path, const ScanOptions& options, Progress& progress);

}  // namespace xraycast
