#pragma once

#include "xraycast/mask/mask.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include <functional>

namespace xraycast {

/// The voxels whose centres lie where `inside` says so.
inline Mask mask_where(const VolumeGeometry& geometry, const std::function<bool(const glm::dvec3&)>& inside) {
  Mask mask(geometry);
  for (std::int64_t z = 0; z < geometry.size.z; ++z)
    for (std::int64_t y = 0; y < geometry.size.y; ++y)
      for (std::int64_t x = 0; x < geometry.size.x; ++x)
        mask[{x, y, z}] = inside(geometry.to_world_mm({x, y, z})) ? 1 : 0;
  return mask;
}

/// Distance from a point to the stretch between two others.
inline double distance_to_segment(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b) {
  const double t = glm::clamp(glm::dot(p - a, b - a) / glm::dot(b - a, b - a), 0.0, 1.0);
  return glm::distance(p, glm::mix(a, b, t));
}

}  // namespace xraycast
