#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/volume/volume.hpp"

#include <vector>

namespace xraycast {

/// A voxel in or about a branch.
struct TubeSample {
  double along_mm;          ///< from the branch's first point to the place of its line that is nearest
  glm::dvec3 from_axis_mm;  ///< from there to the voxel's centre
  double hu;
};

struct SampleReach {
  double beyond_mm;  ///< outside of a branch's wall, and as far inside
  double apart_mm;   ///< from the wall of another branch, at least
  double widest_mm;  ///< radius; what is wider has no samples, and takes none from others
};

/// The voxels in and about each branch of a tree, in the order of `along_mm`. Voxels that lie in another
/// branch too, or beside one, are left out: what they show is not of one vessel.
std::vector<std::vector<TubeSample>> tube_samples(const VesselTree& tree, const Volume& volume,
                                                  const SampleReach& reach);

}  // namespace xraycast
