#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"

#include <glm/vec3.hpp>

#include <string>
#include <vector>

namespace xraycast {

/// How structures that touch are told apart.
struct Markers {
  std::vector<glm::dvec3> vessels_mm;      ///< points in vessels, LPS
  std::vector<glm::dvec3> not_vessels_mm;  ///< points in what is no vessel
  double max_radius_mm = 17;  ///< wherever a larger sphere fits in, it is no vessel but a chamber
};

/// The voxel of a mask that is nearest to a point, at most 5 mm away. Throws InputError, with `name` in
/// front.
Index3 nearest_voxel(const Mask& mask, const glm::dvec3& point_mm, const std::string& name);

/// Parts structures that touch, by a marker-controlled watershed on the distance transform (Beucher and
/// Meyer, The morphological approach to segmentation: the watershed transformation, 1993). Basins that meet
/// stay one when the neck between them is at least half as wide as the narrower of them, as along a vessel;
/// else the mask is opened there. Basins that hold a sphere larger than max_radius_mm, or more than half of
/// which lies in such spheres once muscles within a chamber are closed (the opening of granulometry, Matheron
/// 1975), are taken off, and so are those that hold a point that is no vessel. Spheres that are larger than a
/// radius are larger than a smaller one, too: the smaller it is, the more is taken off. Works on a grid of
/// 1.5 mm or the mask's own, whichever is coarser.
///
/// Throws InputError, with `name` in front, when a point lies farther than 5 mm from the mask.
void part_from_chambers(Mask& mask, const Markers& markers, const std::string& name, Progress& progress);
inline void part_from_chambers(Mask& mask, const Markers& markers, const std::string& name) {
  Progress unheard;
  part_from_chambers(mask, markers, name, unheard);
}

}  // namespace xraycast
