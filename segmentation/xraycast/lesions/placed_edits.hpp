#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/lesions/edits.hpp"

#include <string>
#include <vector>

namespace xraycast {

/// A stenosis on one branch of the given tree.
struct PlacedStenosis {
  int branch;
  double at_mm, length_mm;  ///< within the branch
  double lost;              ///< of the radius, in its middle
  glm::dvec3 towards;       ///< unit vector across the vessel, to the wall that the throat touches; 0: none
  PlaqueKind plaque;

  double first_mm() const { return at_mm - 0.5 * length_mm; }
  double last_mm() const { return at_mm + 0.5 * length_mm; }
};

/// An aneurysm beside one branch of the given tree.
struct PlacedSac {
  int branch;
  double at_mm;
  glm::dvec3 outwards;  ///< unit vector from the centreline to the point
  double diameter_mm, neck_mm;

  /// How far its middle lies beyond the wall, so that the opening is as wide as the neck.
  double height_mm() const;
};

/// Factors of the branches' radii, and of the whole tree.
struct PlacedScales {
  std::vector<double> radii;
  double size = 1;
};

/// Edits of one tree, checked.
struct PlacedEdits {
  std::vector<PlacedStenosis> stenoses;
  std::vector<PlacedSac> sacs;
  std::vector<bool> is_removed;  ///< one for each branch
  PlacedScales scales;

  bool removes_any() const;
};

/// Finds the places of edits. Throws InputError for what the tree cannot have: unknown branches, a stenosis
/// beyond its branch or in its parent's lumen, lesions that overlap or lie on removed branches, a point far
/// from all walls, an aneurysm that its vessel or its neighbours have no room for, the root removed.
PlacedEdits placed_edits(const VesselTree& tree, const Edits& edits);

/// The branches that words mean: a number, or the name of one or several. Throws InputError, with `field` in
/// front.
std::vector<int> branches_meant(const VesselTree& tree, const std::string& words, const std::string& field);

}  // namespace xraycast
