#pragma once

#include "xraycast/volume/volume.hpp"

#include <cstddef>
#include <cstdint>
#include <optional>

namespace xraycast {

/// What is wanted of vessels that are given.
struct GivenVesselsOptions {
  std::optional<glm::dvec3> root_mm;       ///< the tree begins at the vessel end nearest to it
  std::optional<glm::dvec3> component_mm;  ///< of several components, the nearest to it; else the largest
  std::optional<VolumeGeometry> grid;      ///< of a scan, for the mask
  std::int64_t voxels = 120'000'000;       ///< of the grid in which a surface's skeleton is found, at most
  std::size_t triangles = 50'000;          ///< of a surface that is made anew, approximately
};

}  // namespace xraycast
