#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/volume/volume.hpp"

#include <glm/vec3.hpp>

#include <filesystem>

namespace xraycast {

/// A stack of pictures in one file, such as a TIFF of several pages, as a volume: the first page is the
/// lowest slice, rows grow towards posterior, and the first voxel's centre is the origin. Numbers above 32767
/// are clamped. Stage "reading" of `progress`. Throws InputError for pages of different sizes and for
/// spacings that are not above 0, Error as read_grey_picture.
Volume read_stack(const std::filesystem::path& path, const glm::dvec3& spacing_mm, Progress& progress);

/// Turns the volume into its mirror image along x.
void mirror(Volume& volume);

}  // namespace xraycast
