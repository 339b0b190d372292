#pragma once

#include "xraycast/image_file/write_volume.hpp"
#include "xraycast/volume/scan_info.hpp"

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace xraycast {

/// Opens a folder of DICOM or GE Genesis slices, a zip archive of such a folder, or a single DICOM, Genesis,
/// NIfTI, NRRD, MetaImage or VTK ImageData file. Headers are read here (stage "opening"), voxels by the
/// source. An archive is unpacked into a temporary folder (stage "unpacking"), which the source removes.
///
/// A folder is searched with all its subfolders, such as those of a patient's CD, and so is the folder of a
/// DICOMDIR. The best CT series is chosen: the one with the most slices, then an axial one, then the one with
/// the thinnest slices. If there is no CT, other greyscale images are read instead.
///
/// The format is recognised by content, never by name alone. Slices are sorted by position along their
/// normal, rescaled to HU, clamped to [-1024, 32767] and delivered in the frame of VolumeGeometry. Stacks
/// that are sheared, uneven, or not aligned with the patient's axes are resampled onto a grid that is.
///
/// Throws InputError, naming the file and the field, and DamagedSlice for a slice that skip_damaged would
/// leave out.
Scan open_scan(const std::filesystem::path& path, const ScanOptions& options, Progress& progress);

/// Voxels in memory, as if a file named `name` held them: HU of `size` voxels, the first axis fastest.
/// `step_mm` leads from a voxel to the next along each axis, and `origin_mm` is the first voxel's centre,
/// both in LPS. Copies the voxels. Throws InputError, with `name` in front.
Scan open_array(std::span<const std::int16_t> hu, const Index3& size,
                const std::array<glm::dvec3, 3>& step_mm, const glm::dvec3& origin_mm,
                const std::string& name);

}  // namespace xraycast
