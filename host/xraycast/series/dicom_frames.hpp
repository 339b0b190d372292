#pragma once

#include "xraycast/series/dicom_slice.hpp"

namespace xraycast {

/// Adds the slice that a file's header describes, or of a multi-frame file (Enhanced CT and the like, PS3.3,
/// A.38) one slice a frame, in the order of their times. Values come from a frame's own functional groups,
/// from the shared ones, or else from the data set. Of several stacks the one with most frames is taken.
///
/// Throws InputError for what is not supported, and DamagedSlice. Where only some frames are damaged, `fault`
/// says so and the others are there.
void read_slices(const DicomHeader& header, const std::filesystem::path& file, DicomFileSummary& summary);

/// The frames of a file as pictures that lie nowhere, such as X-rays: stored values are not rescaled. Throws
/// InputError for what is not supported, and DamagedSlice.
std::vector<DicomSlice> read_pictures(const DicomHeader& header, const std::filesystem::path& file);

}  // namespace xraycast
