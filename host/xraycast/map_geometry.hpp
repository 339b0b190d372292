#pragma once

#include "xraycast/volume.hpp"

#include <glm/vec2.hpp>

#include <string>
#include <vector>

namespace xraycast {

/// Along which rays a body map collects attenuation.
enum class Projection {
  cylinder,  ///< outwards from the body's axis, within each slice
};

std::string to_string(Projection projection);

/// How the radii of concentric shells are spaced.
enum class RadiiRule {
  equal_area,  ///< radii ~ sqrt(k): every shell holds the same area of a slice; the most accurate for its
               ///< price
  equal_thickness,  ///< radii ~ k
};

/// The `layers` + 1 edges from 0 to `radius_mm`, innermost first.
std::vector<double> shell_radii_mm(RadiiRule rule, int layers, double radius_mm);

/// Where every texel of a body map looks. Angle phi = 0 is anterior and grows towards the patient's left;
/// column i is centred on phi = (i + 1/2) * 360 deg / width; row 0 is the most superior slice.
struct MapGeometry {
  Projection projection = Projection::cylinder;
  int width = 360;                    ///< angles
  int height = 0;                     ///< slices
  std::vector<double> radii_mm;       ///< K + 1 edges of the shells, innermost first
  std::vector<glm::dvec2> centre_mm;  ///< x, y of the axis: one for all rows, or one a row
  double top_mm = 0;                  ///< z of row 0
  double row_spacing_mm = 1;          ///< row j lies at top_mm - j * row_spacing_mm
  double step_mm = 1;  ///< sample i of a ray covers the radii [i, i + 1] * step_mm, taken in its middle

  int layers() const { return static_cast<int>(radii_mm.size()) - 1; }
  double radius_mm() const { return radii_mm.back(); }
  double phi_rad(double column) const;
  double z_mm(double row) const { return top_mm - row * row_spacing_mm; }
  glm::dvec2 centre_of_row_mm(int row) const { return centre_mm.size() == 1 ? centre_mm[0] : centre_mm[row]; }

  bool operator==(const MapGeometry&) const = default;
};

/// The cylinder map of a volume: a row for every slice, and samples at most one pixel apart, so that the last
/// sample ends at the last radius. Throws InputError when the arguments cannot make a map: `angles` outside
/// 1 to 16384, radii that do not ascend from >= 0, or a centre outside the scan.
MapGeometry cylinder_map(const VolumeGeometry& volume, int angles, std::vector<double> radii_mm,
                         glm::dvec2 centre_mm);

/// Throws InputError, with `name` in front, when a geometry that came from a file is not usable.
void validate(const MapGeometry& geometry, const std::string& name);

}  // namespace xraycast
