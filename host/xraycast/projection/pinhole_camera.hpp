#pragma once

#include "xraycast/projection/view.hpp"
#include "xraycast/volume/volume.hpp"

#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <string>

namespace xraycast {

/// An X-ray source and its detector as computer vision describes a camera (OpenCV, nanodrr). A point of the
/// patient at `x` mm (LPS) is at c = rotation * x + translation_mm before the camera, which looks along its
/// z; it is shown at (u, v) pixels, where (u, v, 1) is intrinsics * c / c.z. The middle of the pixel in
/// column 0 and row 0, on top, is at (0, 0).
struct PinholeCamera {
  glm::dmat3 intrinsics{1};
  glm::dmat3 rotation{1};  ///< its determinant may be -1: pictures seen from the detector are mirrored
  glm::dvec3 translation_mm{0, 0, 0};
  int width = 0, height = 0;  ///< pixels

  glm::dvec3 source_mm() const;

  /// From the source to the point with c.z = 1 mm that pixel (i, j) shows, and its changes with i and j.
  glm::dvec3 ray_mm(double i, double j) const;
  glm::dvec3 right_mm() const;
  glm::dvec3 down_mm() const;
};

/// The camera of a view, which must be complete and have a cone.
PinholeCamera camera_of(const View& view);

/// The camera of a picture of `size` whose pixels are means over `factor` x `factor` pixels, from pixel
/// `first` on.
PinholeCamera of_means(PinholeCamera camera, glm::ivec2 first, int factor, glm::ivec2 size);

/// Where the corners of a scan's outer faces are before a camera, in mm: c of PinholeCamera.
std::array<glm::dvec3, 8> corners_before(const PinholeCamera& camera, const VolumeGeometry& scan);

/// Throws InputError, with `name` in front, when a number is not finite, the intrinsics' last row is not
/// (0, 0, 1), the focal length is 0, the rotation is invalid, or a picture's side is outside 1 to 16384.
void validate(const PinholeCamera& camera, const std::string& name);

}  // namespace xraycast
