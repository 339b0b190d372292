#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/projection/view.hpp"

#include <glm/vec2.hpp>

#include <optional>
#include <string>

namespace xraycast {

/// The vessel visible at a point of a view's picture, in pixels from its upper left corner: the place of the
/// tree nearest to where the ray first meets a lumen on its way from the detector; where it meets none, the
/// nearest within four pixels beside it.
std::optional<VesselTree::Location> vessel_at(const VesselTree& tree, const View& view,
                                              const glm::dvec2& pixel);

/// `branch 5, 34 of 120 mm, radius 3.1 mm (mean 3.4), from branch 2 into 7, 8`.
std::string describe(const VesselTree& tree, const VesselTree::Location& place);

}  // namespace xraycast
