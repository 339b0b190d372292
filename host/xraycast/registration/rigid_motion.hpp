#pragma once

#include "xraycast/projection/pinhole_camera.hpp"

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

namespace xraycast {

/// A rigid motion of the scan: x goes to rotation * x + translation_mm, LPS.
struct RigidMotion {
  glm::dmat3 rotation{1};
  glm::dvec3 translation_mm{0, 0, 0};

  glm::dvec3 operator()(const glm::dvec3& x_mm) const { return rotation * x_mm + translation_mm; }
  /// What `first` does, and then this.
  RigidMotion after(const RigidMotion& first) const {
    return {rotation * first.rotation, rotation * first.translation_mm + translation_mm};
  }
  RigidMotion inverse() const;
  double angle_rad() const;
  bool operator==(const RigidMotion&) const = default;
};

/// Turns about `centre_mm` by a rotation vector, whose length is the angle in rad, and then moves.
RigidMotion turned_and_moved(const glm::dvec3& rotation_rad, const glm::dvec3& translation_mm,
                             const glm::dvec3& centre_mm);

/// The camera as it sees the scan after that motion: RT times the motion.
PinholeCamera seeing(PinholeCamera camera, const RigidMotion& motion);

}  // namespace xraycast
