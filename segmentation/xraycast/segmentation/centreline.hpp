#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/evidence/lumen_fill.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mask/mask.hpp"

#include <optional>
#include <string>
#include <vector>

namespace xraycast {

class Lumen;

/// A vessel tree, and the parts of the mask that did not fit a tree.
struct Centrelines {
  VesselTree tree;
  std::vector<int> loops;       ///< branches that closed a cycle, and were cut open there
  std::vector<double> gaps_mm;  ///< lengths of the straight lines that link components of the mask
  int parts_left_out;           ///< components of the mask too far from the others to be in the tree
};

/// Extracts the centrelines of a vessel mask: topology-preserving thinning, the skeleton's graph, its pruning
/// to a forest (cycles opened at their thinnest edge, spurs within their parent's lumen removed), lines moved
/// to the centroids of their cross-sections and smoothed, ends within these cross-sections removed
/// (inner_leaves). The radius is that of the cross-section, bounded by the distance transform; within its
/// parent's lumen a branch keeps the radius that it has outside. Points are at most one voxel apart. Where
/// the `fill` is given, thin vessels have the radii of circles as large as their lumen (radii_from_fill).
/// Where the `lumen` is known better than by the mask's voxels, lines and radii follow it. The root is the
/// free end nearest to `root_mm`; without it the thickest free end of an elongated vessel, which excludes the
/// dome of an aneurysm.
///
/// Throws InputError, with `name` in front, when no structure in the mask is longer than it is wide,
/// and for a root farther than 50 mm from all free ends. Thinning
/// and centring are stages of `progress`.
Centrelines extract_centrelines(const Mask& mask, const std::string& name, Progress& progress,
                                const std::optional<glm::dvec3>& root_mm = {},
                                const LumenFill* fill = nullptr, const Lumen* lumen = nullptr);
inline Centrelines extract_centrelines(const Mask& mask, const std::string& name) {
  Progress unheard;
  return extract_centrelines(mask, name, unheard);
}

}  // namespace xraycast
