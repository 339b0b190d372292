#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mask/mask.hpp"

#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// A vessel tree and where the vessels were no tree.
struct Centrelines {
  VesselTree tree;
  std::vector<int> loops;       ///< branches that led back to another one, and were cut open there
  std::vector<double> gaps_mm;  ///< lengths of the straight lines that join parts of the mask
  int parts_left_out;           ///< parts of the mask too far from the others to be joined to the tree
};

/// The tree of centrelines of a mask of vessels: thinned, read as a graph, spurs that do not reach out of
/// their parent's lumen pruned, loops cut open at their thinnest edge, lines moved to the middle of their
/// cross-sections and smoothed. The radius is the one of the cross-section, bounded by the distance
/// transform; within its parent's lumen a branch keeps the radius that it has outside. Points are at most one
/// voxel apart. The root is the free end nearest to `root_mm`; without it the thickest one of a vessel that
/// is longer than wide, which an aneurysm's dome is not.
///
/// Throws InputError, with `name` in front, when nothing in the mask is longer than it is wide. Thinning and
/// centring are stages of `progress`.
Centrelines find_centrelines(const Mask& mask, const std::string& name, Progress& progress,
                             const std::optional<glm::dvec3>& root_mm = {});
inline Centrelines find_centrelines(const Mask& mask, const std::string& name) {
  Progress unheard;
  return find_centrelines(mask, name, unheard);
}

}  // namespace xraycast
