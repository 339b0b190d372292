#include "xraycast/registration/rigid_motion.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

/// By Rodrigues' formula.
glm::dmat3 rotation_by(const glm::dvec3& vector_rad) {
  const double angle = glm::length(vector_rad);
  if (angle == 0) return glm::dmat3(1);
  const glm::dvec3 a = vector_rad / angle;
  const glm::dmat3 cross(0, a.z, -a.y, -a.z, 0, a.x, a.y, -a.x, 0);  // columns
  return glm::dmat3(1) + std::sin(angle) * cross + (1 - std::cos(angle)) * (cross * cross);
}

}  // namespace

RigidMotion RigidMotion::inverse() const {
  const glm::dmat3 back = glm::transpose(rotation);
  return {back, -(back * translation_mm)};
}

double RigidMotion::angle_rad() const {
  const double trace = rotation[0][0] + rotation[1][1] + rotation[2][2];
  return std::acos(std::clamp((trace - 1) / 2, -1.0, 1.0));
}

RigidMotion turned_and_moved(const glm::dvec3& rotation_rad, const glm::dvec3& translation_mm,
                             const glm::dvec3& centre_mm) {
  const glm::dmat3 rotation = rotation_by(rotation_rad);
  return {rotation, centre_mm - rotation * centre_mm + translation_mm};
}

PinholeCamera seeing(PinholeCamera camera, const RigidMotion& motion) {
  camera.translation_mm = camera.rotation * motion.translation_mm + camera.translation_mm;
  camera.rotation = camera.rotation * motion.rotation;
  return camera;
}

}  // namespace xraycast
