#include "xraycast/registration/start_pose.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/registration/camera_file.hpp"

#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/trigonometric.hpp>

#include <cmath>
#include <filesystem>
#include <sstream>

namespace xraycast {
namespace {

/// The camera's axes at C-arm angles: seen from the detector, as View is, or from behind.
glm::dmat3 rotation_at(double lao_rad, double cranial_rad, bool is_mirrored) {
  View view;
  view.lao_rad = lao_rad;
  view.cranial_rad = cranial_rad;
  const glm::dvec3 right = is_mirrored ? view.right() : -view.right();
  return glm::transpose(glm::dmat3(right, -view.up(), view.towards_detector()));
}

}  // namespace

PinholeCamera looking_at(PinholeCamera camera, const VolumeGeometry& scan) {
  camera.translation_mm -= camera.rotation * scan.middle_mm();
  return camera;
}

RigidMotion read_start(const std::string& text, const PinholeCamera& camera, const VolumeGeometry& scan) {
  if (std::filesystem::exists(text)) return read_motion_matrix(text);
  std::istringstream fields(text);
  double lao_deg = 0, cranial_deg = 0;
  char comma = 0;
  if (!(fields >> lao_deg >> comma >> cranial_deg) || comma != ',' || !(fields >> std::ws).eof())
    throw InputError("--start {}: must be LAO,CRANIAL in degrees, or a file", text);
  if (!(std::abs(lao_deg) <= 180 && std::abs(cranial_deg) <= 90))
    throw InputError("--start {}: angles must be within 180 and 90 degrees", text);
  const glm::dmat3 wanted =
      rotation_at(glm::radians(lao_deg), glm::radians(cranial_deg), glm::determinant(camera.rotation) < 0);
  const glm::dvec3 middle = scan.middle_mm();
  // wanted = camera.rotation * motion.rotation; the middle stays where it is.
  const glm::dmat3 rotation = glm::transpose(camera.rotation) * wanted;
  return {rotation, middle - rotation * middle};
}

}  // namespace xraycast
