#pragma once

#include "xraycast/volume/volume.hpp"

#include <glm/vec2.hpp>

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// The rays along which a body map sums attenuation.
enum class RayLayout {
  cylinder,   ///< outwards from the body's axis, within each slice
  sphere,     ///< outwards from a point, in all directions
  rectangle,  ///< parallel, across the body: one picture per view angle
};

std::string to_string(RayLayout ray_layout);

/// Throws InputError, naming the valid ones, for another name.
RayLayout parse_ray_layout(const std::string& name);

/// How the radii of concentric shells are spaced.
enum class RadiiRule {
  equal_area,  ///< radii ~ sqrt(k): every shell holds the same area of a slice; the most accurate for its
               ///< price
  equal_thickness,  ///< radii ~ k
  near_skin,  ///< radii ~ k^0.43: finer outside, where shells that follow the body have its skin and what is
              ///< parallel to it
};

/// Of a map.
inline constexpr int kMaxLayers = 256;

/// The `layers` + 1 edges from 0 to `radius_mm`, innermost first. Throws InputError unless there are 1 to
/// kMaxLayers and the radius is finite and above 0.
std::vector<double> shell_radii_mm(RadiiRule rule, int layers, double radius_mm);

/// The extent of a scan's data, LPS millimetres: from face to face of its border voxels.
struct FieldOfView {
  glm::dvec3 lower_mm, upper_mm;
  bool operator==(const FieldOfView&) const = default;

  /// As stored in files: the lower corner, then the upper one.
  using Corners = std::array<std::array<double, 3>, 2>;
  Corners corners_mm() const;
  static FieldOfView between(const Corners& corners_mm);
};

/// The field of view of a scan.
FieldOfView field_of(const VolumeGeometry& volume);

/// The ray of every texel of a body map. A map is K layers of `height` x `width` texels.
///
/// - cylinder: angle phi = 0 is anterior and grows towards the patient's left; column i is centred on phi =
///   (i + 1/2) * 360 deg / width; row 0 is the most superior slice; layer k is the shell between radii k and
///   k + 1.
/// - sphere: columns and layers as for the cylinder; row j is centred on the polar angle theta = (j + 1/2) *
/// 180 deg /
///   height from the superior pole.
/// - rectangle: layer k is the parallel picture from the C-arm angle k * 180 deg / views; its mirror image is
/// the
///   one from the other side. Pixels are row_spacing_mm wide and high, columns centred on the axis.
struct MapGeometry {
  RayLayout ray_layout = RayLayout::cylinder;
  int width = 360;  ///< angles, or pixels of a picture
  int height = 0;   ///< slices, or polar angles
  int views = 0;    ///< rectangle only
  std::vector<double>
      radii_mm;  ///< K + 1 edges of the shells, innermost first; rectangle: 0 and half the width
  std::vector<glm::dvec2> centre_mm;  ///< x, y of the axis: one for all rows, or one per row (cylinder)
  double centre_z_mm = 0;             ///< sphere only
  double top_mm = 0;                  ///< z of row 0; not for spheres
  double row_spacing_mm = 1;          ///< row j lies at top_mm - j * row_spacing_mm; not for spheres
  double step_mm = 1;  ///< sample i of a ray covers the radii [i, i + 1] * step_mm, taken in its middle

  /// Shells that follow the body: R, how far they reach, in the direction of every column (for all rows
  /// alike), or of every texel, as in the map. Shell k then lies between radii k and k + 1, taken as
  /// fractions of the largest R, of the R of its direction. Empty: circles, R is radius_mm() everywhere.
  /// Cylinder and sphere.
  std::vector<float> outline_mm{};

  /// The field of view of the scan, beyond which rays meet nothing. Cylinder and sphere; absent in files of
  /// earlier versions.
  std::optional<FieldOfView> field{};

  int layers() const {
    return ray_layout == RayLayout::rectangle ? views : static_cast<int>(radii_mm.size()) - 1;
  }
  double radius_mm() const { return radii_mm.back(); }
  bool has_outline() const { return !outline_mm.empty(); }

  /// Whether the outline, if there is one, is the same in all rows.
  bool has_plane_outline() const { return outline_mm.size() <= static_cast<std::size_t>(width); }

  /// R as a share of the largest: what a length along the ray of a texel is to that between its radii_mm.
  double scale(int column, int row) const;

  /// The radius, as radii_mm have it, of a place that is `radius_mm` from the axis or centre, at a column and
  /// a row of the map which need not be whole.
  double shell_radius_mm(double radius_mm, double column, double row) const;
  double phi_rad(double column) const;
  double theta_rad(double row) const;
  double view_rad(double layer) const;

  /// The radius, in the units of radii_mm, at which a texel's ray leaves the field, rounded to the whole
  /// samples within it, as in casting; radius_mm() if it does not leave.
  double reach_mm(int column, int row) const;

  double z_mm(double row) const { return top_mm - row * row_spacing_mm; }
  glm::dvec2 centre_of_row_mm(int row) const { return centre_mm.size() == 1 ? centre_mm[0] : centre_mm[row]; }

  bool operator==(const MapGeometry&) const = default;
};

/// The cylinder map of a volume: a row for every slice, and samples at most one pixel apart, so that the last
/// sample ends at the last radius. Throws InputError when the arguments cannot make a map: `angles` outside
/// 1 to 16384, radii that do not ascend from >= 0, or a centre outside the scan.
MapGeometry cylinder_map(const VolumeGeometry& volume, int angles, std::vector<double> radii_mm,
                         glm::dvec2 centre_mm);

/// The same about a centre that follows the anatomy: one per row, the most superior first.
MapGeometry cylinder_map(const VolumeGeometry& volume, int angles, std::vector<double> radii_mm,
                         std::vector<glm::dvec2> centre_of_row_mm);

/// The spherical map about a point of the scan: half as many polar angles as `angles`. Throws InputError
/// likewise.
MapGeometry sphere_map(const VolumeGeometry& volume, int angles, std::vector<double> radii_mm,
                       const glm::dvec3& centre_mm);

/// `views` parallel pictures of the cylinder of `radius_mm` about an axis, as fine as the scan's slices.
/// Throws InputError likewise, and for `views` outside 1 to 3600 or pictures of more than 16384 pixels per
/// side.
MapGeometry rectangle_map(const VolumeGeometry& volume, int views, double radius_mm, glm::dvec2 centre_mm);

/// The same cylinder or sphere map with shells that reach as far as an outline, in place of circles: see
/// MapGeometry::outline_mm. Throws InputError as validate() does.
MapGeometry with_outline(MapGeometry circles, std::vector<float> outline_mm);

/// Throws InputError, with `name` in front, when a geometry read from a file is invalid.
void validate(const MapGeometry& geometry, const std::string& name);

}  // namespace xraycast
