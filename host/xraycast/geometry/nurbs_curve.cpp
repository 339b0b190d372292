#include "xraycast/geometry/nurbs_curve.hpp"

#include "xraycast/base/error.hpp"

#include <glm/vec4.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

constexpr int kMaxDegree = 9;

bool all_finite(const glm::dvec3& p) {
  return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

/// The degree + 1 B-spline functions of `degree` that are not 0 in the span of knots (A2.2).
std::vector<double> spline_functions(const std::vector<double>& knots, int span, double t, int degree) {
  std::vector<double> n{1.0};
  for (int j = 1; j <= degree; ++j) {
    std::vector<double> next(static_cast<std::size_t>(j) + 1, 0.0);
    for (int r = 0; r < j; ++r) {
      const double from = knots[span + r + 1 - j], to = knots[span + r + 1];
      const double share = n[r] / (to - from);
      next[r] += (to - t) * share;
      next[r + 1] += (t - from) * share;
    }
    n = std::move(next);
  }
  return n;
}

}  // namespace

NurbsCurve::NurbsCurve(int degree, std::vector<ControlPoint> points, std::vector<double> knots,
                       const std::string& name)
    : degree_(degree), points_(std::move(points)), knots_(std::move(knots)) {
  if (degree < 1 || degree > kMaxDegree)
    throw InputError("{}: a curve of degree {}, but it must be 1 to {}", name, degree, kMaxDegree);
  const auto order = static_cast<std::size_t>(degree) + 1;
  if (points_.size() < order)
    throw InputError("{}: {} control points, but a curve of degree {} needs at least {}", name,
                     points_.size(), degree, order);
  for (std::size_t i = 0; i < points_.size(); ++i)
    if (!all_finite(points_[i].position_mm) || !(points_[i].weight > 0) || !std::isfinite(points_[i].weight))
      throw InputError("{}: control point {} is not finite, or its weight is not above 0", name, i);
  if (knots_.size() != points_.size() + order)
    throw InputError("{}: {} knots, but {} points of degree {} need {}", name, knots_.size(), points_.size(),
                     degree, points_.size() + order);
  const auto is_nan = [](double knot) { return std::isnan(knot); };
  if (!std::is_sorted(knots_.begin(), knots_.end()) || std::any_of(knots_.begin(), knots_.end(), is_nan))
    throw InputError("{}: the knots decrease", name);
  if (knots_[order - 1] != 0 || knots_.front() != 0 || knots_[points_.size()] != 1 || knots_.back() != 1)
    throw InputError("{}: the first {} knots must be 0 and the last {} must be 1", name, order, order);
  for (std::size_t i = 0; i + degree < knots_.size(); ++i)
    if (knots_[i] > 0 && knots_[i] < 1 && knots_[i] == knots_[i + degree])
      throw InputError("{}: knot {} is repeated more than {} times", name, knots_[i], degree);
}

NurbsCurve NurbsCurve::cubic(const std::vector<glm::dvec3>& points_mm, const std::string& name) {
  constexpr int kDegree = 3;
  std::vector<ControlPoint> points;
  for (const glm::dvec3& position_mm : points_mm) points.push_back({position_mm});
  std::vector<double> knots(kDegree, 0.0);
  const int spans = std::max(1, static_cast<int>(points.size()) - kDegree);
  for (int i = 0; i <= spans; ++i) knots.push_back(static_cast<double>(i) / spans);
  knots.insert(knots.end(), kDegree, 1.0);
  return {kDegree, std::move(points), std::move(knots), name};
}

int NurbsCurve::span_of(double t) const {
  const auto last = static_cast<int>(points_.size()) - 1;
  if (t >= 1) {
    int span = last;
    while (knots_[span] >= 1) --span;
    return span;
  }
  return static_cast<int>(std::upper_bound(knots_.begin(), knots_.end(), t) - knots_.begin()) - 1;
}

glm::dvec3 NurbsCurve::at_mm(double t) const {
  t = std::clamp(t, 0.0, 1.0);
  const int span = span_of(t);
  const std::vector<double> n = spline_functions(knots_, span, t, degree_);
  glm::dvec4 homogeneous{0};
  for (std::size_t i = 0; i < n.size(); ++i) {
    const ControlPoint& p = points_[span - degree_ + i];
    homogeneous += n[i] * glm::dvec4(p.position_mm * p.weight, p.weight);
  }
  return glm::dvec3(homogeneous) / homogeneous.w;
}

}  // namespace xraycast
