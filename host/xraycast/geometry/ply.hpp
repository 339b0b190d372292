#pragma once

#include "xraycast/geometry/mesh.hpp"

#include <filesystem>

namespace xraycast {

/// Reads the vertices and faces of a PLY file (Turk, The PLY polygon file format, 1994): ASCII or binary in
/// either byte order, with properties of any number type in any order. Other properties and elements are
/// skipped; polygons are split into fans. Throws InputError, naming file and element, also for a file without
/// faces.
Mesh read_ply(const std::filesystem::path& path);

}  // namespace xraycast
