#pragma once

#include "xraycast/geometry/mesh.hpp"

#include <filesystem>

namespace xraycast {

/// Binary, with `SPACE=LPS` in the header. Throws as write_mesh does.
void write_stl(const Mesh& mesh, const std::filesystem::path& path);

/// Binary or ASCII; points that coincide exactly are merged. Throws InputError, naming file and field.
Mesh read_stl(const std::filesystem::path& path);

}  // namespace xraycast
