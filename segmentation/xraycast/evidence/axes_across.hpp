#pragma once

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include <cmath>
#include <utility>

namespace xraycast {

/// Two directions across one of length one, orthonormal with it.
inline std::pair<glm::dvec3, glm::dvec3> axes_across(const glm::dvec3& direction) {
  const glm::dvec3 helper = std::abs(direction.z) < 0.8 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
  const glm::dvec3 u = glm::normalize(glm::cross(direction, helper));
  return {u, glm::cross(direction, u)};
}

}  // namespace xraycast
