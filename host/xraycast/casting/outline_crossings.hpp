#pragma once

#include "xraycast/casting/map_geometry.hpp"

#include <cmath>
#include <span>
#include <vector>

namespace xraycast {

/// The outline of a row of a cylinder map, seen along the axis: how a straight line crosses its shells.
class OutlineCrossings {
 public:
  explicit OutlineCrossings(const MapGeometry& geometry, int row = 0);

  /// A line that is nearest to the axis at `foot_mm`, given from there, and runs along a unit vector.
  class Line {
   public:
    Line(const OutlineCrossings& outline, const glm::dvec2& foot_mm, const glm::dvec2& direction);

    /// The map's column, which may be beyond its first or last one by whole turns, of a place on the line.
    double column(double along_mm) const { return column_at(std::atan2(along_mm, offset_mm_)); }

    /// The radius, as MapGeometry::radii_mm have it, of a place on the line, which is in this column.
    double shell_radius_mm(double along_mm, double column) const;
    double shell_radius_mm(double along_mm) const { return shell_radius_mm(along_mm, column(along_mm)); }

   private:
    double column_at(double turned_rad) const { return foot_column_ + columns_per_rad_ * turned_rad; }

    const OutlineCrossings* outline_;
    double offset_mm_, foot_column_, columns_per_rad_;
    friend class OutlineCrossings;
  };

  struct Crossing {
    double along_mm;  ///< along the line, 0 at its foot
    int radius;       ///< which one is crossed
  };

  /// Where a line crosses shells of these ascending radii, in order along it. Unlike circles, a shell may be
  /// crossed more than twice.
  std::vector<Crossing> crossings(const Line& line, std::span<const double> radii_mm) const;

 private:
  double scale_at(double column) const;

  int width_;
  std::vector<double> scale_;  ///< of every column, and the first again
};

}  // namespace xraycast
