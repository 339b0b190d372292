#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/geometry/mesh.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/lesions/edited_lumen.hpp"

#include <filesystem>
#include <optional>

namespace xraycast {

/// What a folder of vessels holds.
struct VesselFolder {
  VesselTree tree;
  std::optional<Mesh> surface;
  std::optional<VoxelLumen> lumen;  ///< its mask, and how full voxels are: full, where no file says more
};

/// Reads a folder that `segment`, `vessels` or `phantom` wrote, or the file of a tree alone. Throws
/// InputError.
VesselFolder read_vessel_folder(const std::filesystem::path& path, Progress& progress);

}  // namespace xraycast
