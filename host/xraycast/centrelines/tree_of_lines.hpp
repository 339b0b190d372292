#pragma once

#include "xraycast/centrelines/centreline_file.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <glm/vec3.hpp>

#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// What lines do not say.
struct TreeOfLinesOptions {
  std::optional<glm::dvec3> root_mm = {};       ///< the tree begins at the end that is nearest to it
  std::optional<glm::dvec3> component_mm = {};  ///< of several trees the nearest to it; else that at the root
};

/// A tree, and what was done to lines to make one of them.
struct TreeOfLines {
  VesselTree tree;
  std::vector<int> loops = {};  ///< branches that end where a loop was cut
  int loops_cut = 0;
  int doubled_points = 0;
  int components_left_out = 0;
  std::vector<std::string> notes;  ///< the same in words, one line each
};

/// Makes a tree of centrelines.
///
/// Lines without parents are joined by where they lie. What several have in common, as lines from one root to
/// each target have, is kept once: points that coincide (to a micrometre), or that stay within a quarter of
/// the radius. A branch leaves at the last point that coincides, or at the place where it leaves that
/// quarter. Then an end within another line's radius is joined to that line, whichever way the lines run.
/// Lines with parents are joined to these alone.
///
/// Of what is not connected the longest tree is kept. Of each loop the thinnest piece is cut at its wider
/// end, so that the lumen stays closed. The tree begins at an end: the given one; that of the parents; the
/// only one at which lines start, or the one at which most do; or else the widest. Branches run from there,
/// and have the names of their lines.
///
/// Throws InputError, with `name` in front, for lines that make no tree or violate VesselTree's invariants,
/// and for a point more than 50 mm from the end that it was given for (`root_mm`).
TreeOfLines tree_of_lines(const std::vector<CentrelineLine>& lines, const std::string& name,
                          const TreeOfLinesOptions& options = {});

}  // namespace xraycast
