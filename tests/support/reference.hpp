#pragma once

#include "xraycast/volume/volume.hpp"

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

/// An independent implementation of what the kernels compute: double precision, one thread, written to be
/// read next to the definitions in the manual. It shares nothing with the library but the volume.
namespace xraycast::test {

/// HU -> mu in 1/mm. Always applied after interpolation.
using MuOfHu = std::function<double(double hu)>;

// ---- procedural volumes

/// A grid around the world's origin.
VolumeGeometry centred_geometry(const Index3& size, const glm::dvec3& spacing_mm);

/// Samples `hu` at every voxel centre of centred_geometry(), rounded and clamped to [-1024, 32767].
Volume make_volume(const Index3& size, const glm::dvec3& spacing_mm,
                   const std::function<double(const glm::dvec3& world_mm)>& hu);

/// Smooth and rough at once, different in every slice, without symmetry.
Volume textured_volume(const Index3& size, const glm::dvec3& spacing_mm);

struct Box {
  glm::dvec3 lower_mm, upper_mm;
  bool contains(const glm::dvec3& point_mm) const;
};

/// Boxes of random place and size inside `bounds`; the same for the same seed.
std::vector<Box> random_boxes(int count, const Box& bounds, unsigned seed);

// ---- sampling

/// Bilinear in slice `z`, held at the border voxels' centres up to their faces; air (-1024 HU) beyond.
double sample_hu(const Volume& volume, double x_index, double y_index, std::int64_t z);

/// Trilinear. Coordinates beyond the border voxels' centres are held at them.
double sample_hu(const Volume& volume, const glm::dvec3& index);

/// What of the world the scan fills: from face to face of its border voxels.
Box scan_extent(const VolumeGeometry& geometry);

// ---- maps and projections

/// The unit vector in the axial plane that points to angle phi: 0 is anterior (-y) and it grows to the
/// patient's left.
glm::dvec2 radial_direction(double phi_rad);

/// The angle of map column `column`'s centre.
double column_phi_rad(int column, int angles);

/// The cylinder map, layers x rows x angles. Row 0 is the most superior slice and `centre_mm` has one centre
/// a row. Layer k holds the shell between radii_mm[k] and radii_mm[k + 1]. Sample i stands for radii [i, i +
/// 1] * step_mm and is taken in their middle, in all layers alike; one that straddles an edge counts in both
/// shells, by length.
std::vector<double> reference_cylinder_map(const Volume& volume, std::span<const glm::dvec2> centre_mm,
                                           std::span<const double> radii_mm, int angles, double step_mm,
                                           const MuOfHu& mu);

/// The optical depth between two points by Joseph's method (IEEE Trans. Med. Imaging 1(3), 1982, 192-196):
/// the ray is sampled where it crosses the planes through voxel centres of the axis along which it passes
/// most voxels, bilinear in the plane. Plane k stands for [k - 1/2, k + 1/2], cut to the segment between
/// source and end and to scan_extent().
double reference_joseph(const Volume& volume, const glm::dvec3& source_mm, const glm::dvec3& end_mm,
                        const MuOfHu& mu);

/// The midpoint rule in steps of at most `step_mm`; converges with step_mm^2 where mu is smooth.
double reference_line_integral(const std::function<double(const glm::dvec3& world_mm)>& mu_at,
                               const glm::dvec3& a_mm, const glm::dvec3& b_mm, double step_mm);

// ---- closed forms: how much of the segment from a to b lies in a body

double box_chord_mm(const glm::dvec3& a_mm, const glm::dvec3& b_mm, const Box& box);

/// An ellipsoid, turned about the z axis from +x towards +y.
struct Ellipsoid {
  glm::dvec3 centre_mm, radii_mm;
  double rotation_rad = 0;
  double mu_per_mm = 1;  ///< added to that of the others where they overlap
  bool contains(const glm::dvec3& point_mm) const;
};
double ellipsoid_chord_mm(const glm::dvec3& a_mm, const glm::dvec3& b_mm, const Ellipsoid& ellipsoid);

/// The optical depth of a list of them.
double ellipsoids_line_integral(const glm::dvec3& a_mm, const glm::dvec3& b_mm,
                                std::span<const Ellipsoid> ellipsoids);

/// An upright cylinder.
struct Cylinder {
  glm::dvec2 centre_mm;
  double radius_mm;
  double lower_z_mm, upper_z_mm;
};
double cylinder_chord_mm(const glm::dvec3& a_mm, const glm::dvec3& b_mm, const Cylinder& cylinder);

// ---- closed forms: how much of a map's ray, between two radii about `axis_mm`, lies in a plane figure

double radial_circle_chord_mm(const glm::dvec2& axis_mm, double phi_rad, double inner_mm, double outer_mm,
                              const glm::dvec2& circle_mm, double radius_mm);
double radial_box_chord_mm(const glm::dvec2& axis_mm, double phi_rad, double inner_mm, double outer_mm,
                           const glm::dvec2& lower_mm, const glm::dvec2& upper_mm);

}  // namespace xraycast::test
