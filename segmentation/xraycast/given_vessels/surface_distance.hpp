#pragma once

#include "xraycast/geometry/mesh.hpp"

#include <limits>
#include <memory>

namespace xraycast {

/// How far points lie from the outer wall of a closed surface. Parts of it that overlap, such as the tubes of
/// a tree, count as one: their inner walls are gone. It does not matter which side the normals are on.
class SurfaceDistance {
 public:
  static constexpr double kBand = 3;

  virtual ~SurfaceDistance() = default;

  /// Of the grid on which distances are known.
  virtual double spacing_mm() const = 0;

  /// Below zero inside, trilinear between grid points; at most kBand times the spacing on either side. Safe
  /// to call from several threads.
  virtual double at_mm(const glm::dvec3& point_mm) const = 0;

  /// The outer wall, closed, with normals outwards; its triangles are about as large as the spacing.
  virtual const Mesh& wall() const = 0;
};

double surface_area_mm2(const Mesh& mesh);

/// A spacing for surface_distance: as fine as so many distances beside the wall allow, of which a million
/// takes some 2.5 s of a processor, but not finer than a sixteenth of the vessels' mean radius or half of the
/// least one, where that is known and less.
double spacing_of_distances_mm(const Mesh& mesh,
                               double least_radius_mm = std::numeric_limits<double>::infinity(),
                               double most_distances = 6e6);

/// By OpenVDB, which the first call loads. The wall is that of the given surface to a small part of the
/// spacing; what is thinner than the spacing is lost. Throws Error when the library is not installed beside
/// the program.
std::unique_ptr<SurfaceDistance> surface_distance(const Mesh& closed, double spacing_mm);

}  // namespace xraycast
