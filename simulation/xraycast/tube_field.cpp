#include "xraycast/tube_field.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace xraycast {
namespace {

using Eigen::Vector3d;

// Rounds the cone that the distance to a centreline has there; a hundredth of it is left 2 mm away.
constexpr double kRounding_mm = 0.02;
constexpr double kWidestBlend_mm = 0.5;
// How many branches may meet within reach of one point.
constexpr std::size_t kMostHits = 16;

Vector3d to_eigen(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

/// A branch's points at even steps, as fine as its width asks for.
std::vector<VesselPoint> evenly_spaced(const VesselBranch& branch) {
  double narrowest_mm = std::numeric_limits<double>::infinity();
  for (const VesselPoint& point : branch.points) narrowest_mm = std::min(narrowest_mm, point.radius_mm);
  const double length_mm = branch.arc_length_mm.back();
  const double wanted_mm = std::clamp(0.5 * narrowest_mm, 0.5, 1.5);
  const int pieces = std::max(1, static_cast<int>(std::lround(length_mm / wanted_mm)));
  std::vector<VesselPoint> points;
  std::size_t k = 0;
  for (int i = 0; i <= pieces; ++i) {
    const double arc_mm = length_mm * i / pieces;
    while (k + 2 < branch.points.size() && branch.arc_length_mm[k + 1] < arc_mm) ++k;
    const double fraction = std::clamp(
        (arc_mm - branch.arc_length_mm[k]) / (branch.arc_length_mm[k + 1] - branch.arc_length_mm[k]), 0.0,
        1.0);
    const VesselPoint &from = branch.points[k], &to = branch.points[k + 1];
    points.push_back({from.position_mm + fraction * (to.position_mm - from.position_mm),
                      std::lerp(from.radius_mm, to.radius_mm, fraction)});
  }
  return points;
}

/// The direction over the last stretch of about a radius, which a bent last piece does not turn.
Vector3d outward_direction(const VesselBranch& branch, bool at_start) {
  const auto& points = branch.points;
  const VesselPoint& end = at_start ? points.front() : points.back();
  const auto count = points.size();
  std::size_t k = 1;
  const auto inner = [&](std::size_t i) { return at_start ? points[i] : points[count - 1 - i]; };
  while (k + 1 < count && glm::distance(inner(k).position_mm, end.position_mm) < end.radius_mm) ++k;
  return to_eigen(end.position_mm - inner(k).position_mm).normalized();
}

/// 1 near, 0 from `reach` on, and smooth.
double fade(double distance, double reach) {
  const double t = std::clamp(2 * (1 - distance / reach), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

}  // namespace

std::vector<VesselEnd> vessel_ends(const VesselTree& tree) {
  std::vector<VesselEnd> ends;
  const auto add = [&](int index, bool at_start) {
    const VesselBranch& branch = tree.branches()[static_cast<std::size_t>(index)];
    const VesselPoint& point = at_start ? branch.points.front() : branch.points.back();
    ends.push_back(
        {index, at_start, to_eigen(point.position_mm), outward_direction(branch, at_start), point.radius_mm});
  };
  for (int i = 0; i < static_cast<int>(tree.branches().size()); ++i) {
    if (i == tree.root()) add(i, true);
    if (tree.branches()[static_cast<std::size_t>(i)].children.empty()) add(i, false);
  }
  return ends;
}

TubeField::TubeField(const VesselTree& tree, const VesselEnd* opening, double opening_length_mm) {
  const auto& vessels = tree.branches();
  branches_.resize(vessels.size());
  for (std::size_t i = 0; i < vessels.size(); ++i) {
    Branch& branch = branches_[i];
    std::vector<VesselPoint> points = evenly_spaced(vessels[i]);
    branch.arc_length_mm = vessels[i].arc_length_mm.back();
    branch.step_mm = branch.arc_length_mm / static_cast<double>(points.size() - 1);
    if (opening && opening->branch == static_cast<int>(i)) {
      const int more = static_cast<int>(std::ceil(opening_length_mm / branch.step_mm));
      const glm::dvec3 outward{opening->outward.x(), opening->outward.y(), opening->outward.z()};
      const VesselPoint end = opening->at_start ? points.front() : points.back();
      for (int k = 1; k <= more; ++k) {
        const VesselPoint point{end.position_mm + branch.step_mm * k * outward, end.radius_mm};
        points.insert(opening->at_start ? points.begin() : points.end(), point);
      }
      if (opening->at_start) branch.arc_offset_mm = branch.step_mm * more;
    }
    const std::size_t last = points.size() - 1;
    for (std::size_t k = 0; k <= last; ++k) {
      const glm::dvec3 along =
          points[std::min(k + 1, last)].position_mm - points[k > 0 ? k - 1 : 0].position_mm;
      branch.stations.push_back(
          {to_eigen(points[k].position_mm), to_eigen(along).normalized(), points[k].radius_mm});
    }
    branch.lower_mm = branch.upper_mm = branch.stations.front().centre_mm;
    for (const Station& station : branch.stations) {
      branch.lower_mm = branch.lower_mm.cwiseMin(station.centre_mm);
      branch.upper_mm = branch.upper_mm.cwiseMax(station.centre_mm);
      branch.widest_mm = std::max(branch.widest_mm, station.radius_mm);
    }
  }

  for (std::size_t i = 0; i < vessels.size(); ++i) {
    if (vessels[i].children.empty()) continue;
    Joint joint;
    joint.position_mm = branches_[i].stations.back().centre_mm;
    joint.branches.push_back(static_cast<int>(i));
    branches_[i].end_joint = static_cast<int>(joints_.size());
    double widest_mm = branches_[i].stations.back().radius_mm, narrowest_mm = widest_mm;
    for (const int child : vessels[i].children) {
      Branch& branch = branches_[static_cast<std::size_t>(child)];
      branch.start_joint = static_cast<int>(joints_.size());
      joint.branches.push_back(child);
      widest_mm = std::max(widest_mm, branch.stations.front().radius_mm);
      narrowest_mm = std::min(narrowest_mm, branch.stations.front().radius_mm);
    }
    // At 30 degrees two tubes of one width part at 4 radii from where their centrelines meet.
    joint.reach_mm = 6 * widest_mm;
    joint.blend_mm = std::min(kWidestBlend_mm, 0.25 * narrowest_mm);
    joints_.push_back(std::move(joint));
  }
}

TubeField::Hit TubeField::hit(int index, int from, const Vector3d& point_mm) const {
  const auto& stations = branches_[static_cast<std::size_t>(index)].stations;
  const double step_mm = branches_[static_cast<std::size_t>(index)].step_mm;
  const auto ahead = [&](int i) {
    const Station& station = stations[static_cast<std::size_t>(i)];
    return (point_mm - station.centre_mm).dot(station.tangent);
  };
  const int last = static_cast<int>(stations.size()) - 1;
  int i = std::clamp(from, 0, last - 1);
  double before = ahead(i), behind = ahead(i + 1);
  while (behind > 0 && i + 1 < last) {
    ++i;
    before = behind;
    behind = ahead(i + 1);
  }
  while (before < 0 && i > 0) {
    --i;
    behind = before;
    before = ahead(i);
  }

  const auto round_end = [&](const Station& end, double arc_mm) -> Hit {
    const Vector3d offset = point_mm - end.centre_mm;
    const double distance = std::sqrt(offset.squaredNorm() + kRounding_mm * kRounding_mm);
    return {end.radius_mm - distance, distance, arc_mm, 0, -offset / distance, {index, i}};
  };
  if (before <= 0) return round_end(stations.front(), 0);
  if (behind >= 0) return round_end(stations.back(), step_mm * last);

  // Between the two stations' planes: where along the piece the plane in between goes through the point.
  const Station &a = stations[static_cast<std::size_t>(i)], &b = stations[static_cast<std::size_t>(i) + 1];
  const Vector3d chord = b.centre_mm - a.centre_mm, turn = b.tangent - a.tangent;
  const double linear = (point_mm - a.centre_mm).dot(turn) - chord.dot(a.tangent), square = -chord.dot(turn);
  double t = before / (before - behind);
  for (int k = 0; k < 2; ++k) {
    const double slope = std::min(linear + 2 * square * t, -0.1 * step_mm);
    t = std::clamp(t - (before + (linear + square * t) * t) / slope, 0.0, 1.0);
  }
  const Vector3d offset = point_mm - a.centre_mm - t * chord, tangent = a.tangent + t * turn;
  const double distance = std::sqrt(offset.squaredNorm() + kRounding_mm * kRounding_mm);
  const Vector3d away = offset / distance;
  const double widening = b.radius_mm - a.radius_mm + away.dot(chord);
  // Where the planes of a sharp bend meet, t would change without bound.
  const double crossing = std::max(chord.dot(tangent) - offset.dot(turn), 0.2 * step_mm);
  return {std::lerp(a.radius_mm, b.radius_mm, t) - distance,
          distance,
          step_mm * (i + t),
          0,
          widening / crossing * tangent - away,
          {index, i}};
}

double TubeField::highest_value_mm(const Branch& branch, const Vector3d& point_mm) const {
  const Vector3d nearest = point_mm.cwiseMax(branch.lower_mm).cwiseMin(branch.upper_mm);
  return branch.widest_mm - (point_mm - nearest).norm();
}

int TubeField::guess(int index, int joint, const Vector3d& point_mm) const {
  const Branch& branch = branches_[static_cast<std::size_t>(index)];
  const double away_mm = (point_mm - joints_[static_cast<std::size_t>(joint)].position_mm).norm();
  const int steps = static_cast<int>(std::min(away_mm / branch.step_mm, 1e6));
  return branch.start_joint == joint ? steps : static_cast<int>(branch.stations.size()) - 2 - steps;
}

TubeField::Sample TubeField::at(const Vector3d& point_mm, const Place& from) const {
  std::array<Hit, kMostHits> hits;
  std::size_t count = 0;
  hits[count++] = hit(from.branch, from.segment, point_mm);
  hits[0].blend_mm = std::numeric_limits<double>::infinity();

  // The branches that meet it nearby, and those that meet these nearby.
  std::array<int, kMostHits> passed;
  std::size_t passed_count = 0;
  for (std::size_t h = 0; h < count; ++h) {
    const Branch& branch = branches_[static_cast<std::size_t>(hits[h].place.branch)];
    for (const int joint_index : {branch.start_joint, branch.end_joint}) {
      if (joint_index < 0 || passed_count == kMostHits) continue;
      const Joint& joint = joints_[static_cast<std::size_t>(joint_index)];
      const double distance2 = (point_mm - joint.position_mm).squaredNorm();
      if (distance2 >= joint.reach_mm * joint.reach_mm) continue;
      const auto passed_end = passed.begin() + static_cast<std::ptrdiff_t>(passed_count);
      if (std::find(passed.begin(), passed_end, joint_index) != passed_end) continue;
      passed[passed_count++] = joint_index;
      const double blend_mm =
          std::min(hits[h].blend_mm, joint.blend_mm * fade(std::sqrt(distance2), joint.reach_mm));
      for (const int other : joint.branches) {
        if (count == kMostHits || other == hits[h].place.branch) continue;
        const Branch& vessel = branches_[static_cast<std::size_t>(other)];
        if (highest_value_mm(vessel, point_mm) < hits[0].value_mm - blend_mm) continue;
        hits[count] = hit(other, guess(other, joint_index, point_mm), point_mm);
        hits[count++].blend_mm = blend_mm;
      }
    }
  }

  // A maximum that is rounded where two come within `blend` of each other.
  std::size_t best = 0;
  for (std::size_t h = 1; h < count; ++h)
    if (hits[h].value_mm > hits[best].value_mm) best = h;
  const Hit& top = hits[best];
  double clearance = top.value_mm;
  Vector3d gradient = top.gradient;
  for (std::size_t h = 0; h < count; ++h) {
    const double blend = std::min(hits[h].blend_mm, top.blend_mm);
    const double overlap = blend - (top.value_mm - hits[h].value_mm);
    if (h == best || !(overlap > 0) || !(blend > 0)) continue;
    const double weight = overlap / (2 * blend);
    clearance += 0.5 * overlap * weight;
    gradient += weight * (hits[h].gradient - top.gradient);
  }
  const Branch& branch = branches_[static_cast<std::size_t>(top.place.branch)];
  return {clearance, gradient, top.from_centre_mm, top.place,
          std::clamp(top.arc_mm - branch.arc_offset_mm, 0.0, branch.arc_length_mm)};
}

TubeField::Place TubeField::locate(const Vector3d& point_mm) const {
  Place best;
  double clearance = -std::numeric_limits<double>::infinity();
  for (std::size_t b = 0; b < branches_.size(); ++b)
    for (std::size_t k = 0; k < branches_[b].stations.size(); ++k) {
      const Station& station = branches_[b].stations[k];
      const double here = station.radius_mm - (point_mm - station.centre_mm).norm();
      if (here <= clearance) continue;
      clearance = here;
      best = {static_cast<int>(b), static_cast<int>(std::min(k, branches_[b].stations.size() - 2))};
    }
  return best;
}

}  // namespace xraycast
