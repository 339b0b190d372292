#pragma once

#include "xraycast/coaxial/treatment.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mechanics/stent_model.hpp"
#include "xraycast/scene/scene.hpp"

#include <glm/vec3.hpp>

#include <functional>
#include <span>
#include <vector>

namespace xraycast {

/// The struts and links of rings of a stent, each opened to a radius, as thin tubes of cobalt-chromium or, of
/// one that opens itself, of nitinol: a surface a ring and a link. `axis_mm`: the place on their axis so far
/// beyond their middle, negative before it.
std::vector<Surface> stent_surfaces(const StentModel& stent, std::span<const double> radii_mm,
                                    const std::function<glm::dvec3(double beyond_mm)>& axis_mm);

/// The same of one that was left in a tree's vessel.
std::vector<Surface> stent_surfaces(const PlacedStent& stent, const VesselTree& tree);

}  // namespace xraycast
