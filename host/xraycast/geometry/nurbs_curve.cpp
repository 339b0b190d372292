#include "xraycast/geometry/nurbs_curve.hpp"

#include "xraycast/base/error.hpp"

#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

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

/// The control points of the derivative of a spline by its parameter, of one degree less (Eq. 3.4).
std::vector<glm::dvec4> derived(const std::vector<glm::dvec4>& points, const std::vector<double>& knots,
                                int degree) {
  std::vector<glm::dvec4> result;
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const double span = knots[i + degree + 1] - knots[i + 1];
    result.push_back(span > 0 ? (points[i + 1] - points[i]) * (degree / span) : glm::dvec4(0));
  }
  return result;
}

}  // namespace

NurbsCurve::NurbsCurve(int degree, std::vector<ControlPoint> points, std::vector<double> knots,
                       const std::string& name)
    : degree_(degree), points_(std::move(points)), knots_(std::move(knots)) {
  if (degree < 1 || degree > kMaxDegree)
    throw InputError("{}: a curve of degree {}, but it has to be 1 to {}", name, degree, kMaxDegree);
  const auto order = static_cast<std::size_t>(degree) + 1;
  if (points_.size() < order)
    throw InputError("{}: {} control points, but a curve of degree {} needs at least {}", name,
                     points_.size(), degree, order);
  for (std::size_t i = 0; i < points_.size(); ++i)
    if (!all_finite(points_[i].position_mm) || !(points_[i].weight > 0) || !std::isfinite(points_[i].weight))
      throw InputError("{}: control point {} is not finite, or its weight not above 0", name, i);
  if (knots_.size() != points_.size() + order)
    throw InputError("{}: {} knots, but {} points of degree {} need {}", name, knots_.size(), points_.size(),
                     degree, points_.size() + order);
  if (!std::ranges::is_sorted(knots_) || std::ranges::any_of(knots_, [](double k) { return std::isnan(k); }))
    throw InputError("{}: the knots fall", name);
  if (knots_[order - 1] != 0 || knots_.front() != 0 || knots_[points_.size()] != 1 || knots_.back() != 1)
    throw InputError("{}: the first {} knots have to be 0 and the last {} have to be 1", name, order, order);
  for (std::size_t i = 0; i + degree < knots_.size(); ++i)
    if (knots_[i] > 0 && knots_[i] < 1 && knots_[i] == knots_[i + degree])
      throw InputError("{}: knot {} is there more than {} times", name, knots_[i], degree);
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

NurbsCurve NurbsCurve::circle(const glm::dvec3& centre_mm, const glm::dvec3& x_mm, const glm::dvec3& y_mm) {
  // Four quarters, each a conic whose middle point is the corner of the square around it (Fig. 7.16).
  constexpr double kCorner = std::numbers::sqrt2 / 2;
  constexpr std::array<glm::dvec2, 9> kSquare{
      {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}, {1, 0}}};
  std::vector<ControlPoint> points;
  for (std::size_t i = 0; i < kSquare.size(); ++i)
    points.push_back({centre_mm + kSquare[i].x * x_mm + kSquare[i].y * y_mm, i % 2 == 1 ? kCorner : 1.0});
  return {2, std::move(points), {0, 0, 0, 0.25, 0.25, 0.5, 0.5, 0.75, 0.75, 1, 1, 1}, "circle"};
}

int NurbsCurve::span_of(double t) const {
  const auto last = static_cast<int>(points_.size()) - 1;
  if (t >= 1) {
    int span = last;
    while (knots_[span] >= 1) --span;
    return span;
  }
  return static_cast<int>(std::ranges::upper_bound(knots_, t) - knots_.begin()) - 1;
}

std::vector<double> NurbsCurve::basis(double t) const {
  t = std::clamp(t, 0.0, 1.0);
  const int span = span_of(t);
  const std::vector<double> n = spline_functions(knots_, span, t, degree_);
  std::vector<double> all(points_.size(), 0.0);
  double sum = 0;
  for (int i = 0; i <= degree_; ++i) {
    const int point = span - degree_ + i;
    all[point] = n[i] * points_[point].weight;
    sum += all[point];
  }
  for (double& value : all) value /= sum;
  return all;
}

glm::dvec3 NurbsCurve::derivative_mm(double t, int order) const {
  t = std::clamp(t, 0.0, 1.0);
  // The curve is A(t) / w(t); A and w are splines, which the points hold together.
  std::vector<glm::dvec4> points;
  for (const ControlPoint& p : points_) points.emplace_back(p.position_mm * p.weight, p.weight);
  std::vector<double> knots = knots_;
  std::array<glm::dvec4, 3> homogeneous{};
  for (int k = 0; k <= std::min({order, 2, degree_}); ++k) {
    if (k > 0) {
      points = derived(points, knots, degree_ - k + 1);
      knots = {knots.begin() + 1, knots.end() - 1};
    }
    const int span = span_of(t) - k;
    const std::vector<double> n = spline_functions(knots, span, t, degree_ - k);
    for (std::size_t i = 0; i < n.size(); ++i) homogeneous[k] += n[i] * points[span - (degree_ - k) + i];
  }
  // Leibniz (Eq. 4.8): A = w C, differentiated as often as asked.
  const auto [a, da, dda] = homogeneous;
  const glm::dvec3 c = glm::dvec3(a) / a.w;
  if (order == 0) return c;
  const glm::dvec3 dc = (glm::dvec3(da) - da.w * c) / a.w;
  if (order == 1) return dc;
  return (glm::dvec3(dda) - 2.0 * da.w * dc - dda.w * c) / a.w;
}

}  // namespace xraycast
