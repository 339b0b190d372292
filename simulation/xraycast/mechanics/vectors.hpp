#pragma once

#include <glm/vec3.hpp>

#include <Eigen/Core>

namespace xraycast {

// Vessel trees use GLM's vectors, mechanics Eigen's.
inline Eigen::Vector3d to_eigen(const glm::dvec3& v) { return {v.x, v.y, v.z}; }
inline glm::dvec3 to_glm(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace xraycast
