#pragma once

#include "xraycast/volume/volume.hpp"

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace xraycast {

/// The segments of a DICOM Segmentation on the grid of its frames. Many files lack the frames without voxels,
/// so that it may be a part of the scan's.
struct SegContent {
  VolumeGeometry geometry;
  std::vector<std::string> labels;     ///< of the segments, as Segment Label (0062,0005) says
  std::vector<std::uint8_t> segments;  ///< for each voxel, x fastest, 0 or the number of its label from 1 on
};

/// Whether a file is a DICOM Segmentation or a Label Map Segmentation (PS3.3, A.51).
bool is_seg_file(const std::filesystem::path& path);

/// Reads segments: all of them, or those with these labels or Segment Numbers. BINARY ones, FRACTIONAL ones
/// from half of the maximum on, and label maps; uncompressed, along the patient's axes. Where segments
/// overlap, the first one keeps the voxel. Throws InputError, naming the file and the element, or `labels`
/// for a segment that is not there, which lists those that are.
SegContent read_seg(const std::filesystem::path& path, const std::vector<std::string>& labels = {});

}  // namespace xraycast
