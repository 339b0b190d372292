#pragma once

#include "xraycast/geometry/mesh.hpp"

#include <filesystem>

namespace xraycast {

/// Reads the vertices and faces of a Wavefront OBJ file and ignores all else; polygons are split into fans.
/// Throws InputError, naming file and line, also for a file without faces.
Mesh read_obj(const std::filesystem::path& path);

}  // namespace xraycast
