#pragma once

#include "xraycast/volume/scan_info.hpp"

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace xraycast {

/// How the mask of a DICOM Segmentation was made, as stated in the file.
struct SegOptions {
  bool is_automatic = true;  ///< without points or a mask that a person gave
  std::string software_version{};
};

/// Why a mask on the scan's grid cannot be written as a DICOM Segmentation of the scan's slices, in words
/// that follow a file's name; empty where it can.
std::string why_no_seg(const ScanInfo& scan);

/// Writes a mask of vessels, 1 inside and 0 outside, x fastest, on the grid of a DICOM series, as a DICOM
/// Segmentation (1.2.840.10008.5.1.4.1.1.66.4, PS3.3 A.51): BINARY, one segment, the lumen of blood vessels,
/// one frame per slice from the most inferior. Study, patient and frame of reference are the series', each
/// frame has the position of its slice and names it as its source, and the series is new; if the slices have
/// no common frame of reference, that is new too.
///
/// `slice_spacing_mm` is the distance between slices. `scan` passes why_no_seg, and has a voxel for each of
/// `mask`. Throws InputError when `path` cannot be written, Error when the disk is full.
void write_seg(const ScanInfo& scan, double slice_spacing_mm, std::span<const std::uint8_t> mask,
               const SegOptions& options, const std::filesystem::path& path);

}  // namespace xraycast
