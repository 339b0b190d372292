#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace xraycast {

/// A mask, and which structure each of its voxels belongs to.
struct LabelledMask {
  Mask mask;
  std::vector<std::uint8_t> structures;  ///< for each voxel, the number of its name from 1 on; none: unknown
  std::vector<std::string> names;        ///< as vessels are named; empty for labels that have none
  std::vector<std::string> notes{};      ///< on where the file says that it lies
};

/// The voxels of a file that are above zero; with `labels`, numbers or TotalSegmentator's names of vessels,
/// those that have one of these values. In a folder that has a file of each label's name, such as
/// `aorta.nii.gz`, the voxels above zero in these files. Of a DICOM Segmentation the segments, or those with
/// these numbers or labels.
///
/// Throws InputError, naming the file and the field `labels`: for a label that is not there, which lists
/// those that are; for labels in a file whose voxels lie oblique to the patient's axes, which would be mixed;
/// for more than 255 labels; for files on different grids; for a scan, which is no mask; and for a folder of
/// masks without labels.
LabelledMask read_labelled_mask(const std::filesystem::path& path, const std::vector<std::string>& labels,
                                Progress& progress);

}  // namespace xraycast
