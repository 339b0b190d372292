#pragma once

#include "xraycast/geometry/nurbs_curve.hpp"
#include "xraycast/mechanics/marker_model.hpp"

#include <glm/vec3.hpp>

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace xraycast {

/// An instrument with fewer is not drawn: of a cubic.
inline constexpr std::size_t kFewestNodes = 4;

/// The clamped cubic through an instrument's nodes (four or more; see NurbsCurve::cubic), by progressive
/// iteration (Lin, Bao and Wang, Totally positive bases and progressive iteration approximation, 2005).
NurbsCurve curve_through(const std::vector<glm::dvec3>& nodes_mm);

/// The control points of the curve through nodes; none for fewer than four.
std::vector<glm::dvec3> controls_of(const std::vector<glm::dvec3>& nodes_mm);

/// The end of an instrument as it is drawn, by the length from its tip.
class DrawnEnd {
 public:
  /// Of kFewestNodes nodes or more; at least `reach_mm` of it, where it is as long.
  DrawnEnd(const std::vector<glm::dvec3>& nodes_mm, double reach_mm);

  double length_mm() const { return from_tip_mm_.back(); }
  /// At a length from the tip; straight on beyond either end.
  glm::dvec3 at_mm(double from_tip_mm) const;
  /// kFewestNodes points or more between two lengths from the tip, from the hub's side on; none where less
  /// than a tenth of a millimetre is there.
  std::vector<glm::dvec3> nodes_between(double from_mm, double to_mm) const;

 private:
  std::vector<glm::dvec3> points_mm_;
  std::vector<double> from_tip_mm_;
};

/// The nodes of an instrument, and then of each marker's part of it; none of a marker that has yet to enter.
std::vector<std::vector<glm::dvec3>> lengths_of(const std::vector<glm::dvec3>& nodes_mm,
                                                std::span<const MarkerModel> markers);

/// The middle of each marker; none of one that has yet to enter.
std::vector<std::optional<glm::dvec3>> middles_of(const std::vector<glm::dvec3>& nodes_mm,
                                                  std::span<const MarkerModel> markers);

}  // namespace xraycast
