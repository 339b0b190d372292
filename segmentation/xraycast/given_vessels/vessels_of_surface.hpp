#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/geometry/mesh.hpp"
#include "xraycast/given_vessels/given_vessels_options.hpp"
#include "xraycast/segmentation/vessels.hpp"

#include <string>

namespace xraycast {

/// The tree of a surface, in LPS mm, that is closed or open at the ends of its vessels. Its voxels are
/// thinned on a grid of at most `options.voxels`; lines and radii follow distances to the wall on a finer
/// one. Open ends of vessels become ends of the tree, other openings are closed. A surface in one closed
/// piece stays as it is; else the outer wall of all its parts is made anew.
///
/// Throws InputError, with `name` in front, as `repaired` and extract_centrelines do, and for a surface that
/// is too small or too large for vessels, which names the unit that would fit.
Vessels vessels_of_surface(const Mesh& surface, const GivenVesselsOptions& options, const std::string& name,
                           Progress& progress);

}  // namespace xraycast
