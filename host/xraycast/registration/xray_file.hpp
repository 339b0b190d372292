#pragma once

#include "xraycast/registration/xray.hpp"

#include <filesystem>
#include <vector>

namespace xraycast {

/// Reads an X-ray: a picture file of any depth, or the frames of an X-ray in DICOM (XA, RF, DX or CR),
/// plain or compressed, one X-ray each. Throws InputError, naming the file.
///
/// DICOM's frames have a camera where the file states the positioner's angles, the distances of source,
/// detector and patient, and the pixel spacing on the detector: of an isocentre at the origin, as View sees
/// it.
std::vector<Xray> read_xrays(const std::filesystem::path& path);

}  // namespace xraycast
