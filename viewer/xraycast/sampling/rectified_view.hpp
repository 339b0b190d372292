#pragma once

#include "xraycast/sampling/camera.hpp"

#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>

namespace xraycast {

/// A view's rays as an upright detector in the plane through the view's centre would gather them: all rays of
/// one of its columns lie in one vertical plane, also when the C-arm is tilted or its beam a cone, so that
/// they pass the same places of a map's circles, merely at other heights. Drawing the upright picture and
/// looking each of the view's pixels up in it is therefore much less work than following every pixel's ray.
///
/// Columns and rows are counted from the left and downwards, centred on whole numbers. A ray is followed by
/// s, the millimetres it has gone horizontally from the upright plane towards the detector.
struct RectifiedView {
  glm::dvec2 centre_mm;       ///< x, y of the view's centre
  glm::dvec2 right, forward;  ///< horizontal unit vectors: along the columns' row; towards the detector
  double source_mm = 0;       ///< horizontally from a cone's source to the plane; 0 for parallel beams
  double source_z_mm = 0;     ///< of a cone
  double slope = 0;           ///< rise over run of a parallel beam
  int columns = 0, rows = 0;  ///< as many as the map's body takes of the view; 0 when it is out of sight
  double left_mm = 0, column_mm = 1;  ///< column i crosses the plane at left + i * column, along `right`
  double top_mm = 0, row_mm = 1;      ///< row j crosses it at height top - j * row
  glm::dmat3 from_pixel{1};           ///< (i + 1/2, j + 1/2, 1) of the view to homogeneous (column, row)

  bool is_cone() const { return source_mm > 0; }
  double column_x_mm(double column) const { return left_mm + column * column_mm; }

  /// Where a column's rays cross the plane (x, y), and their horizontal direction.
  glm::dvec2 origin_mm(double column) const { return centre_mm + column_x_mm(column) * right; }
  glm::dvec2 direction(double column) const;

  /// Rise over run of a column's ray that crosses the plane at a height.
  double slope_at(double column, double z_mm) const;

  /// The column and row of a pixel's ray, (i, j) as for View::pixel_on_detector_mm.
  glm::dvec2 of_pixel(double i, double j) const;
};

/// How many of the view's pixels a column of the upright picture takes; a row takes no more.
inline constexpr int kFullResolution = 1;

/// The upright picture of what a cylinder or rectangle map has of `view`, which has to be complete. An
/// untilted parallel view has the map's own rows. Throws InputError when rays run within 10 deg of the axis.
RectifiedView rectified_view(const View& view, const MapGeometry& geometry,
                             int pixels_per_column = kFullResolution);

}  // namespace xraycast
