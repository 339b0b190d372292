#pragma once

#include "xraycast/casting/map_geometry.hpp"
#include "xraycast/projection/view.hpp"

#include <optional>
#include <string>

namespace xraycast {

/// The upright cylinder that bounds a map's body.
struct BodyBounds {
  glm::dvec3 centre_mm{0, 0, 0};  ///< on the axis at mid-height
  double radius_mm = 1;           ///< about the axis
  double half_height_mm = 1;
  double finest_mm = 1;  ///< the map's resolution

  bool holds(const glm::dvec3& point_mm) const;
};

/// The bounds of a map's rays. About a curved axis the circle encloses every row's circle.
BodyBounds bounds_of(const MapGeometry& geometry);

/// The pose of C-arm and table: rotation about the body's axis, cranial or caudal tilt, the table's travel
/// along the axis and across it, and the magnification.
struct CArmPose {
  double lao_rad = 0;      ///< LAO is positive
  double cranial_rad = 0;  ///< cranial is positive
  double table_mm = 0;     ///< height of the picture's centre above mid-height
  double zoom = 1;         ///< 1: the whole body fits
  std::optional<Cone> cone{};
  glm::dvec2 across_mm{0, 0};  ///< the picture's centre from the axis, towards the patient's left and back

  static constexpr double kMinZoom = 0.25, kMaxZoom = 40;
  static constexpr double kMaxTilt_rad = 0.8726646259971648;  ///< 50 deg, farther than C-arms go

  /// Relative moves, clamped to the limits above and to the body; the angle wraps around at 180 deg.
  void rotate(double degrees);
  void tilt(double degrees);
  void travel(double mm, const BodyBounds& bounds);
  void travel(const glm::dvec3& mm, const BodyBounds& bounds);
  void magnify(double times);

  bool operator==(const CArmPose&) const = default;
};

/// A named standard projection.
struct CArmPreset {
  const char* name;
  double angle_deg;
};
inline constexpr CArmPreset kCArmPresets[] = {{"AP", 0}, {"LAO 45", 45}, {"RAO 30", -30}, {"Lateral", 90}};

/// A pose's view of a body on a detector of that many pixels. Throws InputError as `fitted` does.
View view_of(const CArmPose& pose, const BodyBounds& bounds, int width, int height);

/// The view with pixel size and picture size set where they are 0, as `fitted` does for a scan.
View fitted(View view, const BodyBounds& bounds);

/// `LAO 30 / CRA 10   table +12 mm   x1.5`.
std::string status_of(const CArmPose& pose);

}  // namespace xraycast
