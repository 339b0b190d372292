#include "xraycast/projection/pinhole_camera.hpp"

#include "xraycast/base/error.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <cmath>

namespace xraycast {
namespace {

bool is_finite(const glm::dmat3& m) {
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row)
      if (!std::isfinite(m[column][row])) return false;
  return true;
}

/// Of matrices that were written with six decimals or so.
constexpr double kMatrixRounding = 1e-5;

bool is_orthonormal(const glm::dmat3& m) {
  const glm::dmat3 square = glm::transpose(m) * m;
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row)
      if (!(std::abs(square[column][row] - (column == row ? 1 : 0)) < kMatrixRounding)) return false;
  return true;
}

}  // namespace

glm::dvec3 PinholeCamera::source_mm() const { return -(glm::transpose(rotation) * translation_mm); }

glm::dvec3 PinholeCamera::ray_mm(double i, double j) const {
  return glm::transpose(rotation) * (glm::inverse(intrinsics) * glm::dvec3(i, j, 1));
}

glm::dvec3 PinholeCamera::right_mm() const { return glm::transpose(rotation) * glm::inverse(intrinsics)[0]; }

glm::dvec3 PinholeCamera::down_mm() const { return glm::transpose(rotation) * glm::inverse(intrinsics)[1]; }

PinholeCamera camera_of(const View& view) {
  // Seen from the source x runs against the picture's right, so that x, y and z are right-handed.
  PinholeCamera camera;
  camera.rotation = glm::transpose(glm::dmat3(-view.right(), -view.up(), view.towards_detector()));
  camera.translation_mm = -(camera.rotation * view.source_mm());
  const double focal = view.cone->source_detector_mm / view.pixel_mm;
  camera.intrinsics = glm::dmat3(glm::dvec3(-focal, 0, 0), glm::dvec3(0, focal, 0),
                                 glm::dvec3(0.5 * (view.width - 1), 0.5 * (view.height - 1), 1));
  camera.width = view.width;
  camera.height = view.height;
  return camera;
}

PinholeCamera of_means(PinholeCamera camera, glm::ivec2 first, int factor, glm::ivec2 size) {
  for (const int axis : {0, 1}) {
    camera.intrinsics[2][axis] = (camera.intrinsics[2][axis] - first[axis] - (factor - 1) / 2.0) / factor;
    camera.intrinsics[axis][axis] /= factor;
  }
  camera.intrinsics[1][0] /= factor;
  camera.width = size.x;
  camera.height = size.y;
  return camera;
}

std::array<glm::dvec3, 8> corners_before(const PinholeCamera& camera, const VolumeGeometry& scan) {
  std::array<glm::dvec3, 8> corners_mm = corners_of(scan.lower_mm(), scan.upper_mm());
  for (glm::dvec3& corner_mm : corners_mm) corner_mm = camera.rotation * corner_mm + camera.translation_mm;
  return corners_mm;
}

void validate(const PinholeCamera& camera, const std::string& name) {
  constexpr int kMaxPictureSide = 16384;
  constexpr double kMaxDistance_mm = 1e6;  // single precision still tells voxels apart there
  const glm::dmat3& k = camera.intrinsics;
  if (!is_finite(k) || k[0][2] != 0 || k[1][2] != 0 || k[2][2] != 1)
    throw InputError("{}: K must be finite, with (0, 0, 1) in its last row", name);
  if (!(std::abs(k[0][0] * k[1][1] - k[1][0] * k[0][1]) > 1e-9))
    throw InputError("{}: K has no focal length; K[0][0] and K[1][1] must be the focal length in pixels",
                     name);
  if (!is_finite(camera.rotation) || !is_orthonormal(camera.rotation))
    throw InputError("{}: the first three columns of RT must be a rotation", name);
  if (!(glm::length(camera.translation_mm) <= kMaxDistance_mm))
    throw InputError("{}: the last column of RT must be at most {} mm long", name, kMaxDistance_mm);
  if (camera.width < 1 || camera.width > kMaxPictureSide || camera.height < 1 ||
      camera.height > kMaxPictureSide)
    throw InputError("{}: a picture of {} x {} pixels: each side must be 1 to {}", name, camera.width,
                     camera.height, kMaxPictureSide);
}

}  // namespace xraycast
