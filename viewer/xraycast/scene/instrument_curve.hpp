#pragma once

#include "xraycast/geometry/nurbs_curve.hpp"

#include <glm/vec3.hpp>

#include <cstddef>
#include <vector>

namespace xraycast {

/// An instrument with fewer is not drawn: of a cubic.
inline constexpr std::size_t kFewestNodes = 4;

/// The clamped cubic through an instrument's nodes (four or more; see NurbsCurve::cubic), by progressive
/// iteration (Lin, Bao and Wang, Totally positive bases and progressive iteration approximation, 2005).
NurbsCurve curve_through(const std::vector<glm::dvec3>& nodes_mm);

/// The control points of the curve through nodes; none for fewer than four.
std::vector<glm::dvec3> controls_of(const std::vector<glm::dvec3>& nodes_mm);

/// The nodes of each length of an instrument that is of one material. A catheter is one length. A guide wire,
/// which has no lumen, has two, also where one of them has no nodes: its core, and its tip of kWireTip_mm.
std::vector<std::vector<glm::dvec3>> lengths_of(const std::vector<glm::dvec3>& nodes_mm, bool has_lumen);
inline constexpr double kWireTip_mm = 30;

}  // namespace xraycast
