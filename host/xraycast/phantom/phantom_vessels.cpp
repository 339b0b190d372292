#include "xraycast/phantom/phantom_vessels.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>

#include <algorithm>
#include <cassert>
#include <cmath>

namespace xraycast {
namespace {

/// The cubic between p[1] and p[2] at parameter t, by Barry and Goldman's pyramid; knots[i] is the parameter
/// of p[i].
glm::dvec4 catmull_rom(const glm::dvec4 (&p)[4], const double (&knots)[4], double t) {
  const auto blend = [&](const glm::dvec4& from, const glm::dvec4& to, int i, int j) {
    return ((knots[j] - t) * from + (t - knots[i]) * to) / (knots[j] - knots[i]);
  };
  const glm::dvec4 a1 = blend(p[0], p[1], 0, 1), a2 = blend(p[1], p[2], 1, 2), a3 = blend(p[2], p[3], 2, 3);
  return blend(blend(a1, a2, 0, 2), blend(a2, a3, 1, 3), 1, 2);
}

}  // namespace

std::vector<VesselPoint> smooth_curve(std::span<const VesselPoint> controls, double step_mm) {
  assert(controls.size() >= 2);
  const auto last = static_cast<std::ptrdiff_t>(controls.size()) - 1;
  const auto control = [&](std::ptrdiff_t i) {
    const VesselPoint& point = controls[static_cast<std::size_t>(i)];
    return glm::dvec4(point.position_mm, point.radius_mm);
  };
  std::vector<VesselPoint> curve{controls.front()};
  for (std::ptrdiff_t i = 0; i < last; ++i) {
    const glm::dvec4 from = control(i), to = control(i + 1);
    const glm::dvec4 points[4] = {i > 0 ? control(i - 1) : 2.0 * from - to, from, to,
                                  i + 2 <= last ? control(i + 2) : 2.0 * to - from};
    double knots[4] = {};
    for (int k = 1; k < 4; ++k)
      knots[k] = knots[k - 1] + std::sqrt(glm::length(glm::dvec3(points[k] - points[k - 1])));
    // A bent piece is longer than its chord; a tenth more covers the bends of a body.
    const int pieces =
        std::max(1, static_cast<int>(std::ceil(1.1 * glm::length(glm::dvec3(to - from)) / step_mm)));
    for (int k = 1; k < pieces; ++k) {
      const glm::dvec4 p =
          catmull_rom(points, knots, glm::mix(knots[1], knots[2], static_cast<double>(k) / pieces));
      curve.push_back({glm::dvec3(p), p.w});
    }
    curve.push_back(controls[static_cast<std::size_t>(i + 1)]);
  }
  return curve;
}

std::vector<int> VesselGrower::grow(int parent, double first_radius_mm, std::vector<VesselPoint> controls,
                                    std::initializer_list<std::size_t> forks) {
  constexpr double kPointStep_mm = 1;
  std::vector<glm::dvec3> cuts;
  for (const std::size_t fork : forks) cuts.push_back(controls[fork].position_mm);
  if (parent != kRoot)
    controls.insert(controls.begin(),
                    {branches_[static_cast<std::size_t>(parent)].points.back().position_mm, first_radius_mm});

  std::vector<int> grown;
  const auto begin_branch = [&] {
    branches_.push_back({{}, grown.empty() ? parent : grown.back(), {}, {}});
    grown.push_back(static_cast<int>(branches_.size()) - 1);
  };
  begin_branch();
  auto cut = cuts.begin();
  for (const VesselPoint& point : smooth_curve(controls, kPointStep_mm)) {
    branches_.back().points.push_back(point);
    if (cut == cuts.end() || point.position_mm != *cut) continue;
    ++cut;
    begin_branch();
    branches_.back().points.push_back(point);
  }
  return grown;
}

}  // namespace xraycast
