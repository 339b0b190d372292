#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"

#include <glm/vec3.hpp>

#include <string>
#include <vector>

namespace xraycast {

/// Markers that separate touching structures.
struct Markers {
  std::vector<glm::dvec3> vessels_mm;      ///< points in vessels, LPS
  std::vector<glm::dvec3> not_vessels_mm;  ///< points in structures to exclude
  double max_radius_mm = 17;               ///< a structure in which a larger sphere fits is a heart chamber
};

/// The voxel of a mask that is nearest to a point, at most 5 mm away. Throws InputError, with `name` in
/// front.
Index3 nearest_voxel(const Mask& mask, const glm::dvec3& point_mm, const std::string& name);

/// Separates structures that touch, by a marker-controlled watershed on the distance transform (Beucher and
/// Meyer, The morphological approach to segmentation: the watershed transformation, 1993). Basins that meet
/// merge when the neck between them is at least half as wide as the narrower of them, as along a vessel; else
/// the mask is cut there. Basins that hold a sphere larger than max_radius_mm, or more than half of which
/// survives the opening by such spheres once papillary muscles within a chamber are closed (granulometry:
/// Matheron, Random sets and integral geometry, 1975), are removed, and so are those that hold a point to
/// exclude. The smaller the radius, the more is removed. Works on a grid of 1.5 mm or the mask's own,
/// whichever is coarser.
///
/// Throws InputError, with `name` in front, when a point lies farther than 5 mm from the mask.
void separate_chambers(Mask& mask, const Markers& markers, const std::string& name, Progress& progress);
inline void separate_chambers(Mask& mask, const Markers& markers, const std::string& name) {
  Progress unheard;
  separate_chambers(mask, markers, name, unheard);
}

}  // namespace xraycast
