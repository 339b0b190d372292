#include "xraycast/scene/instrument_curve.hpp"

#include <glm/geometric.hpp>

namespace xraycast {
namespace {

/// The first node of a wire's tip; 0 where what is left of the shaft is too short to be drawn.
std::size_t tip_begin(const std::vector<glm::dvec3>& nodes_mm) {
  double length_mm = 0;
  std::size_t first = nodes_mm.size();
  while (first > 1 && length_mm < kWireTip_mm) {
    --first;
    length_mm += glm::distance(nodes_mm[first - 1], nodes_mm[first]);
  }
  return first < kFewestNodes ? 0 : first - 1;
}

}  // namespace

NurbsCurve curve_through(const std::vector<glm::dvec3>& nodes_mm) {
  // The parameter at which each control point has most weight: its Greville abscissa, the mean of its three
  // inner knots.
  const NurbsCurve first = NurbsCurve::cubic(nodes_mm, "catheter");
  std::vector<double> greville;
  for (std::size_t i = 0; i < nodes_mm.size(); ++i)
    greville.push_back((first.knots()[i + 1] + first.knots()[i + 2] + first.knots()[i + 3]) / 3);
  std::vector<glm::dvec3> controls = nodes_mm;
  // Each iteration leaves a third of the distance or less.
  constexpr int kIterations = 8;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const NurbsCurve curve = NurbsCurve::cubic(controls, "catheter");
    for (std::size_t i = 0; i < controls.size(); ++i) controls[i] += nodes_mm[i] - curve.at_mm(greville[i]);
  }
  return NurbsCurve::cubic(controls, "catheter");
}

std::vector<glm::dvec3> controls_of(const std::vector<glm::dvec3>& nodes_mm) {
  std::vector<glm::dvec3> controls;
  if (nodes_mm.size() < kFewestNodes) return controls;
  const NurbsCurve curve = curve_through(nodes_mm);
  for (const NurbsCurve::ControlPoint& point : curve.points()) controls.push_back(point.position_mm);
  return controls;
}

std::vector<std::vector<glm::dvec3>> lengths_of(const std::vector<glm::dvec3>& nodes_mm, bool has_lumen) {
  if (has_lumen) return {nodes_mm};
  const auto tip = nodes_mm.begin() + static_cast<std::ptrdiff_t>(tip_begin(nodes_mm));
  // They share the node between them.
  return {{nodes_mm.begin(), tip == nodes_mm.begin() ? tip : tip + 1}, {tip, nodes_mm.end()}};
}

}  // namespace xraycast
