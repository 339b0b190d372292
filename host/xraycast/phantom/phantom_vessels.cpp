#include "xraycast/phantom/phantom_vessels.hpp"

#include "xraycast/phantom/embedded_phantoms.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <iterator>
#include <set>
#include <utility>

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

/// For each course the control points, but for the last one, at which others leave it.
std::vector<std::set<std::size_t>> forks_of(std::span<const VesselCourse> courses) {
  std::vector<std::set<std::size_t>> forks(courses.size());
  for (const VesselCourse& course : courses)
    if (const auto parent = static_cast<std::size_t>(course.parent);
        course.parent >= 0 && course.leaves_at + 1 < courses[parent].controls.size())
      forks[parent].insert(course.leaves_at);
  return forks;
}

/// Cuts a curve into branches at points of it, each but the first one a child of the one before.
void append_branches(const std::vector<VesselPoint>& curve, const std::vector<glm::dvec3>& cuts_mm,
                     int parent, const std::string& name, std::vector<VesselBranch>& branches) {
  branches.push_back({{}, parent, {}, {}, name});
  auto cut = cuts_mm.begin();
  for (const VesselPoint& point : curve) {
    branches.back().points.push_back(point);
    if (cut == cuts_mm.end() || point.position_mm != *cut) continue;
    ++cut;
    branches.push_back({{point}, static_cast<int>(branches.size()) - 1, {}, {}, name});
  }
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

std::vector<VesselCourse> vessel_courses(const std::string& file, std::vector<VesselCourse> earlier) {
  const auto embedded = std::ranges::find(embedded_phantoms(), file, &EmbeddedFile::name);
  assert(embedded != embedded_phantoms().end());
  std::vector<VesselCourse> courses = std::move(earlier);
  const auto index_of = [&](const std::string& name) {
    const auto found = std::ranges::find(courses, name, &VesselCourse::name);
    assert(found != courses.end());
    return static_cast<int>(found - courses.begin());
  };
  const auto description = nlohmann::json::parse(embedded->source);
  for (const auto& vessel : description.at("vessels")) {
    VesselCourse course{.name = vessel.at("name").get<std::string>(), .controls = {}};
    if (vessel.contains("parent")) {
      course.parent = index_of(vessel.at("parent").get<std::string>());
      course.leaves_at = vessel.at("leaves_at").get<std::size_t>();
      course.first_radius_mm = vessel.at("first_radius").get<double>();
    }
    for (const auto& point : vessel.at("points")) {
      const auto p = point.get<std::array<double, 4>>();
      course.controls.push_back({{p[0], p[1], p[2]}, p[3]});
    }
    courses.push_back(std::move(course));
  }
  return courses;
}

std::vector<VesselBranch> grow_vessels(std::span<const VesselCourse> courses) {
  constexpr double kPointStep_mm = 1;
  const std::vector<std::set<std::size_t>> forks = forks_of(courses);
  std::vector<VesselBranch> branches;
  std::vector<std::size_t> first_branches;
  for (std::size_t i = 0; i < courses.size(); ++i) {
    const VesselCourse& course = courses[i];
    first_branches.push_back(branches.size());
    std::vector<glm::dvec3> cuts_mm;
    for (const std::size_t fork : forks[i]) cuts_mm.push_back(course.controls[fork].position_mm);
    std::vector<VesselPoint> controls = course.controls;
    int parent = -1;
    if (course.parent >= 0) {
      const auto vessel = static_cast<std::size_t>(course.parent);
      const auto earlier_forks =
          std::distance(forks[vessel].begin(), forks[vessel].lower_bound(course.leaves_at));
      const std::size_t branch = first_branches[vessel] + static_cast<std::size_t>(earlier_forks);
      parent = static_cast<int>(branch);
      controls.insert(controls.begin(), {branches[branch].points.back().position_mm, course.first_radius_mm});
    }
    append_branches(smooth_curve(controls, kPointStep_mm), cuts_mm, parent, course.name, branches);
  }
  return branches;
}

}  // namespace xraycast
