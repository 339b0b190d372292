#pragma once

#include "xraycast/geometry/vtp.hpp"

#include <filesystem>

namespace xraycast {

/// Reads a VTK file of the format before XML, versions 1 to 5, with PolyData in it: ASCII or binary. Points
/// are converted to LPS where the title says `SPACE=RAS` or a field array `SPACE` says RAS. Scalars and field
/// arrays become arrays; other attributes, texts and metadata are skipped. Nothing in the file is trusted, as
/// in read_vtp. Throws InputError, naming file and field.
PolyData read_legacy_vtk(const std::filesystem::path& path);

}  // namespace xraycast
