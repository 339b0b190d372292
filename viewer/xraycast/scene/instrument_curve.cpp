#include "xraycast/scene/instrument_curve.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

/// None where the instrument is too short to be drawn, or has no markers.
std::optional<DrawnEnd> marked_end(const std::vector<glm::dvec3>& nodes_mm,
                                   std::span<const MarkerModel> markers) {
  if (nodes_mm.size() < kFewestNodes || markers.empty()) return {};
  double reach_mm = 0;
  for (const MarkerModel& marker : markers) reach_mm = std::max(reach_mm, marker.end_from_tip_mm());
  return DrawnEnd(nodes_mm, reach_mm);
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

DrawnEnd::DrawnEnd(const std::vector<glm::dvec3>& nodes_mm, double reach_mm) {
  // So far beyond what is asked for that the curve is the whole instrument's.
  constexpr double kMore_mm = 20;
  std::size_t first = nodes_mm.size() - 1;
  for (double mm = 0; first > 0 && (mm < reach_mm + kMore_mm || nodes_mm.size() - first < kFewestNodes);
       --first)
    mm += glm::distance(nodes_mm[first], nodes_mm[first - 1]);
  const NurbsCurve curve =
      curve_through({nodes_mm.begin() + static_cast<std::ptrdiff_t>(first), nodes_mm.end()});
  constexpr std::size_t kPerNode = 8;
  const std::size_t count = kPerNode * (nodes_mm.size() - first);
  const double from = curve.knots().front(), to = curve.knots().back();
  for (std::size_t i = 0; i <= count; ++i) {
    const glm::dvec3 point_mm =
        curve.at_mm(std::lerp(to, from, static_cast<double>(i) / static_cast<double>(count)));
    from_tip_mm_.push_back(i == 0 ? 0 : from_tip_mm_.back() + glm::distance(point_mm, points_mm_.back()));
    points_mm_.push_back(point_mm);
  }
}

glm::dvec3 DrawnEnd::at_mm(double from_tip_mm) const {
  const auto beyond = std::lower_bound(from_tip_mm_.begin() + 1, from_tip_mm_.end() - 1, from_tip_mm);
  const auto k = static_cast<std::size_t>(beyond - from_tip_mm_.begin());
  const double share = (from_tip_mm - from_tip_mm_[k - 1]) / (from_tip_mm_[k] - from_tip_mm_[k - 1]);
  return glm::mix(points_mm_[k - 1], points_mm_[k], share);
}

std::vector<glm::dvec3> DrawnEnd::nodes_between(double from_mm, double to_mm) const {
  constexpr double kLeast_mm = 0.1, kRounding_mm = 1e-9, kSpacing_mm = 1.5;
  to_mm = std::min(to_mm, length_mm());
  if (to_mm - from_mm < kLeast_mm - kRounding_mm) return {};
  const int steps = std::max(static_cast<int>(kFewestNodes) - 1,
                             static_cast<int>(std::ceil((to_mm - from_mm) / kSpacing_mm)));
  std::vector<glm::dvec3> nodes_mm;
  for (int i = 0; i <= steps; ++i)
    nodes_mm.push_back(at_mm(std::lerp(to_mm, from_mm, static_cast<double>(i) / steps)));
  return nodes_mm;
}

std::vector<std::vector<glm::dvec3>> lengths_of(const std::vector<glm::dvec3>& nodes_mm,
                                                std::span<const MarkerModel> markers) {
  std::vector<std::vector<glm::dvec3>> lengths{nodes_mm};
  lengths.resize(1 + markers.size());
  if (const std::optional<DrawnEnd> end = marked_end(nodes_mm, markers))
    for (std::size_t m = 0; m < markers.size(); ++m)
      lengths[1 + m] = end->nodes_between(markers[m].from_tip_mm, markers[m].end_from_tip_mm());
  return lengths;
}

std::vector<std::optional<glm::dvec3>> middles_of(const std::vector<glm::dvec3>& nodes_mm,
                                                  std::span<const MarkerModel> markers) {
  std::vector<std::optional<glm::dvec3>> middles(markers.size());
  if (const std::optional<DrawnEnd> end = marked_end(nodes_mm, markers))
    for (std::size_t m = 0; m < markers.size(); ++m)
      if (const double at_mm = markers[m].middle_from_tip_mm(); at_mm <= end->length_mm())
        middles[m] = end->at_mm(at_mm);
  return middles;
}

}  // namespace xraycast
