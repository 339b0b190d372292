#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace xraycast {

/// The voxels of a file that are above zero; with `labels`, numbers or TotalSegmentator's names of vessels,
/// those that have one of these values. In a folder that has a file of each label's name, such as
/// `aorta.nii.gz`, the voxels above zero in these files.
///
/// Throws InputError, naming the file and the field `labels`: for a label that is not there, which lists
/// those that are; for labels in a file whose voxels lie oblique to the patient's axes, which would be mixed;
/// and for files on different grids.
Mask read_labelled_mask(const std::filesystem::path& path, const std::vector<std::string>& labels,
                        Progress& progress);

}  // namespace xraycast
