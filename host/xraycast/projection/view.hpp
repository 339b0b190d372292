#pragma once

#include "xraycast/volume/body_outline.hpp"
#include "xraycast/volume/volume.hpp"

#include <glm/vec3.hpp>

#include <optional>
#include <string>

namespace xraycast {

/// The cone beam of a C-arm.
struct Cone {
  double source_axis_mm;      ///< from the source to the view's centre, the isocentre
  double source_detector_mm;  ///< from the source to the detector
  bool operator==(const Cone&) const = default;
};

/// A C-arm and its detector. The angle is the position of the detector: LAO is positive; cranial tilt is
/// positive. The picture is seen from the detector, so that at 0 deg the patient's left is on the right, and
/// up is superior.
struct View {
  double lao_rad = 0;
  double cranial_rad = 0;
  std::optional<Cone> cone{};     ///< none: a parallel beam
  glm::dvec3 centre_mm{0, 0, 0};  ///< the point on the axis that the picture's centre shows
  int width = 0, height = 0;      ///< pixels
  double pixel_mm = 0;            ///< measured on the detector

  glm::dvec3 towards_detector() const;  ///< n = (sin a cos t, -cos a cos t, sin t)
  glm::dvec3 right() const;             ///< (cos a, sin a, 0)
  glm::dvec3 up() const;                ///< n x right

  /// The middle of pixel (i, j), row 0 on top: on the detector of a cone, else in the plane through the
  /// centre.
  glm::dvec3 pixel_on_detector_mm(double i, double j) const;

  /// The position of the cone's source. Only with a cone.
  glm::dvec3 source_mm() const;

  bool operator==(const View&) const = default;
};

/// `LAO 30 / CRA 10`, as a C-arm displays its angles; never a bare sign.
std::string label(const View& view);

/// Sets pixel size and picture size where they are 0, so that the body's circle and the whole height of the
/// scan fit at every angle. `pixel_mm` of 0: the scan's finest spacing, or the pixel size with which the
/// given picture size fits. Throws InputError for an invalid view: a picture above 16384 pixels per side, a
/// source at the centre, a detector nearer than the centre.
View fitted(View view, const VolumeGeometry& volume, const BodyOutline& body);

}  // namespace xraycast
