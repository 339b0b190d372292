#pragma once

#include "xraycast/projection/projector.hpp"
#include "xraycast/projection/xa_file.hpp"

#include <filesystem>

namespace xraycast {

/// Writes a projection by the extension: `.exr` and `.tif` hold float tau with the view in their metadata;
/// `.nrrd` holds float tau with the picture's pose in space, which 3D Slicer loads; `.dcm` is a DICOM X-Ray
/// Angiographic Image of the transmission (see XaWriter); names that write_picture knows hold the displayed
/// picture: exp(-tau) in the automatic window, with this gamma, inverted or not. Throws InputError for
/// another extension or a path that cannot be written, Error when the disk is full.
void write_projection(const ProjectionImage& image, const std::filesystem::path& path, double gamma = 1,
                      bool inverted = false, const XaOptions& xa = {});

/// A detector's signal in keV of absorbed energy per pixel, H x W, row 0 on top: `.exr` (channel
/// `energy_kev`),
/// `.tif` and `.nrrd`, with the view as above. Throws as write_projection.
void write_detector_signal(const View& view, const std::vector<float>& signal_kev,
                           const std::filesystem::path& path);

/// Whether write_projection writes the displayed picture under this name instead of optical depths.
bool is_picture(const std::filesystem::path& path);

/// Throws InputError, naming the supported ones, when write_projection does not support the extension of
/// `path`.
void check_projection_format(const std::filesystem::path& path);

}  // namespace xraycast
