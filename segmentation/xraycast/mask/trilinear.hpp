#pragma once

#include "xraycast/mask/mask.hpp"

#include <glm/common.hpp>

#include <vector>

namespace xraycast {

/// Trilinear interpolation of the values of `grid`'s voxels, x fastest, at `low` + `fraction` (0 to 1 along
/// each axis). Voxels of weight 0 are not read and may lie beyond the grid.
template <typename Value>
double trilinear(const Mask& grid, const std::vector<Value>& values, const Index3& low,
                 const glm::dvec3& fraction) {
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Index3 step(corner & 1, corner >> 1 & 1, corner >> 2);
    const glm::dvec3 w = glm::mix(1.0 - fraction, fraction, glm::dvec3(step));
    const double weight = w.x * w.y * w.z;
    if (weight > 0) sum += weight * static_cast<double>(values[grid.offset(low + step)]);
  }
  return sum;
}

}  // namespace xraycast
