#pragma once

#include "xraycast/casting/map_geometry.hpp"

#include <span>
#include <vector>

namespace xraycast {

/// The outline of a cylinder map that is the same in all rows, seen along the axis: how a straight line
/// crosses its shells.
class OutlineCrossings {
 public:
  /// Of a map with a plane outline (MapGeometry::has_plane_outline).
  explicit OutlineCrossings(const MapGeometry& geometry);

  /// A line that is nearest to the axis at `foot_mm`, given from there, and runs along a unit vector.
  class Line {
   public:
    Line(const OutlineCrossings& outline, const glm::dvec2& foot_mm, const glm::dvec2& direction);

    /// The radius, as MapGeometry::radii_mm have it, of a place on the line.
    double shell_radius_mm(double along_mm) const;

   private:
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
