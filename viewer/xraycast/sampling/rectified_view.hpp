#pragma once

#include "xraycast/sampling/c_arm_pose.hpp"

#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>

namespace xraycast {

/// A view's rays resampled onto a rectified detector: the vertical plane through the view's centre that faces
/// the detector. All rays of one of its columns lie in one vertical plane, also when the C-arm is tilted or
/// its beam a cone, so that they sample a map's circles at the same places, merely at other heights. Drawing
/// the rectified picture and looking each pixel up in it is much cheaper than marching along every pixel's
/// ray.
///
/// Columns and rows are counted from the left and downwards, centred on whole numbers. The parameter of a ray
/// is s, its horizontal distance in millimetres from the plane, positive towards the detector.
struct RectifiedView {
  glm::dvec2 centre_mm;       ///< x, y of the view's centre
  glm::dvec2 right, forward;  ///< horizontal unit vectors: along the columns' row; towards the detector
  double source_mm = 0;       ///< horizontal distance from a cone's source to the plane; 0: a parallel beam
  double source_z_mm = 0;     ///< of a cone
  double slope = 0;           ///< rise over run of a parallel beam
  int columns = 0, rows = 0;  ///< those in which the map's body is seen; 0 when it is out of sight
  double left_mm = 0, column_mm = 1;  ///< column i crosses the plane at left + i * column, along `right`
  double top_mm = 0, row_mm = 1;      ///< row j crosses it at height top - j * row
  glm::dmat3 from_pixel{1};           ///< (i + 1/2, j + 1/2, 1) of the view to homogeneous (column, row)

  bool is_cone() const { return source_mm > 0; }
  double column_x_mm(double column) const { return left_mm + column * column_mm; }

  /// Where a column's rays cross the plane (x, y), and their horizontal direction.
  glm::dvec2 origin_mm(double column) const { return centre_mm + column_x_mm(column) * right; }
  glm::dvec2 direction(double column) const;
};

/// One column of the rectified picture for every pixel of the view; a row is no coarser either. Under a cone
/// or a tilt there are two, except for pictures so large that OpenGL could not draw into twice as many.
inline constexpr int kFullResolution = 1;

/// The rectified picture of a cylinder or rectangle map in `view`, which must be complete. Untilted parallel
/// views have the map's own rows. Throws InputError when rays run within 10 deg of the axis.
RectifiedView rectified_view(const View& view, const MapGeometry& geometry,
                             int pixels_per_column = kFullResolution);

}  // namespace xraycast
