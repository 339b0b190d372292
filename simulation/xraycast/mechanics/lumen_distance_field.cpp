#include "xraycast/mechanics/lumen_distance_field.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace xraycast {
namespace {

using Eigen::Matrix3d, Eigen::Vector3d;

// Rounds the cone that the distance to a centreline has there; a hundredth of it is left 2 mm away.
constexpr double kRounding_mm = 0.02;
constexpr double kWidestBlend_mm = 0.5;
// How far outside the lumen a point is still looked for with care.
constexpr double kBeyondWall_mm = 1;
// How many branches may lie within reach of one point, and how many of them around it.
constexpr std::size_t kMaxReached = 64, kMaxHits = 16;

Vector3d to_eigen(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

double rounded_length(const Vector3d& v) { return std::sqrt(v.squaredNorm() + kRounding_mm * kRounding_mm); }

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

}  // namespace

LumenDistanceField::LumenDistanceField(const VesselTree& tree, const VesselEnd* opening,
                                       double opening_length_mm) {
  const auto& vessels = tree.branches();
  branches_.resize(vessels.size());
  for (std::size_t i = 0; i < vessels.size(); ++i) {
    Branch& branch = branches_[i];
    branch.blend_mm = kWidestBlend_mm;
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
          {to_eigen(points[k].position_mm), to_eigen(along).normalized(), points[k].radius_mm,
           k > 0 && k < last ? 0.5 * (points[k + 1].radius_mm - points[k - 1].radius_mm) : 0});
    }
    mark_folds(branch);
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
    joint.parting_mm = 4 * widest_mm;
    joint.reach_mm = 6 * widest_mm;
    for (const int branch : joint.branches) {
      double& blend_mm = branches_[static_cast<std::size_t>(branch)].blend_mm;
      blend_mm = std::min(blend_mm, 0.25 * narrowest_mm);
    }
    joints_.push_back(std::move(joint));
  }
}

Matrix3d LumenDistanceField::Rounding::curvature(const Vector3d& gradient) const {
  const Matrix3d sphere = Matrix3d::Identity() - gradient * gradient.transpose();
  if (!(change < 0)) return sphere / distance_mm;  // at a bend's focus, where it has none
  return (sphere + aside * aside.transpose() / change) / distance_mm;
}

Matrix3d LumenDistanceField::Sample::curvature() const {
  const Rounding* one = std::get_if<Rounding>(&wall);
  return one ? one->curvature(gradient) : std::get<Matrix3d>(wall);
}

LumenDistanceField::Piece LumenDistanceField::piece(const Branch& branch, int index) {
  const Station &a = branch.stations[static_cast<std::size_t>(index)],
                &b = branch.stations[static_cast<std::size_t>(index) + 1];
  const Vector3d chord = b.centre_mm - a.centre_mm;
  const double step_mm = branch.step_mm, wider = b.radius_mm - a.radius_mm;
  return {a.centre_mm,
          step_mm * a.tangent,
          3 * chord - step_mm * (2 * a.tangent + b.tangent),
          step_mm * (a.tangent + b.tangent) - 2 * chord,
          a.radius_mm,
          a.widening_mm,
          3 * wider - 2 * a.widening_mm - b.widening_mm,
          a.widening_mm + b.widening_mm - 2 * wider};
}

double LumenDistanceField::growth(const Piece& piece, double t, const Vector3d& point_mm) {
  const Vector3d offset = point_mm - piece.centre_mm(t);
  return offset.dot(piece.along(t)) + rounded_length(offset) * piece.widening(t);
}

void LumenDistanceField::mark_folds(Branch& branch) {
  // Into so many parts is a piece cut in which more than one place may be the best of its surroundings. Two
  // in one part are missed still, but differ the less the shorter it is, by its third power.
  constexpr int kParts = 16;
  auto& stations = branch.stations;
  const int last = static_cast<int>(stations.size()) - 1;
  for (int k = 0; k < last; ++k) {
    const Piece& cubic = branch.pieces.emplace_back(piece(branch, k));
    // A derivative stays in the hull of its Bezier points, and so within these bounds all along the piece.
    const std::array along{cubic.along(0), Vector3d(cubic.slope + cubic.bend), cubic.along(1)};
    const std::array widenings{cubic.widening(0), cubic.start_widening + cubic.bulge, cubic.widening(1)};
    const Vector3d forwards = (along[0] + along[1] + along[2]).normalized();
    double turning = 0, slowest = branch.step_mm, fastest = 0, widening = 0;
    for (const double t : {0.0, 1.0})
      turning = std::max(turning, cubic.turning(t).norm() + std::abs(cubic.widening_change(t)));
    for (std::size_t i = 0; i < along.size(); ++i) {
      slowest = std::clamp(along[i].dot(forwards), 0.0, slowest);
      fastest = std::max(fastest, along[i].norm());
      widening = std::max(widening, std::abs(widenings[i]));
    }
    branch.steepest_mm = std::max(branch.steepest_mm, fastest + widening);
    const auto index = static_cast<std::size_t>(k);
    const double reach_mm =
        std::max(stations[index].radius_mm, stations[index + 1].radius_mm) + kBeyondWall_mm;
    if (turning * reach_mm < slowest * slowest - widening * widening) continue;
    stations[index].parts = kParts;
    // Whatever lies this side of the wall on both sides of the bend.
    const int nearby = static_cast<int>(std::ceil(2 * reach_mm / branch.step_mm));
    for (int i = std::max(0, k - nearby); i <= std::min(last, k + nearby); ++i) {
      int& folded = stations[static_cast<std::size_t>(i)].folded;
      folded = std::max(folded, 2 * nearby);
    }
  }
}

LumenDistanceField::Hit LumenDistanceField::hit(int index, int from, const Vector3d& point_mm) const {
  const Branch& branch = branches_[static_cast<std::size_t>(index)];
  // Above zero where the spheres of the stations to come reach further around the point than this one's.
  const auto ahead = [&](int i) {
    const Station& station = branch.stations[static_cast<std::size_t>(i)];
    const Vector3d offset = point_mm - station.centre_mm;
    const double along = offset.dot(station.tangent) * branch.step_mm;
    return station.widening_mm == 0 ? along : along + rounded_length(offset) * station.widening_mm;
  };
  const int last = static_cast<int>(branch.stations.size()) - 1;
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
  Hit best = before <= 0 && i == 0          ? hit_end(branch, false, point_mm)
             : behind >= 0 && i + 1 == last ? hit_end(branch, true, point_mm)
                                            : hit_piece(branch, i, {0, 1, before, behind}, point_mm);
  best.place = {index, i};
  const int nearby = branch.stations[static_cast<std::size_t>(i)].folded;
  if (nearby > 0) {
    // On the inner side of a sharp bend more than one place may be the best of its surroundings.
    const auto take_if_better = [&](const Hit& other, int k) {
      if (other.value_mm() <= best.value_mm()) return;
      best = other;
      best.place = {index, k};
    };
    const int first = std::max(0, i - nearby), end = std::min(last, i + 1 + nearby);
    for (int k = first; k < end;) {
      // So far that none before it is better.
      const Station& station = branch.stations[static_cast<std::size_t>(k)];
      const double value_mm = station.radius_mm - rounded_length(point_mm - station.centre_mm);
      const double behind_best = (best.value_mm() - value_mm) / branch.steepest_mm;
      if (behind_best > 1) {
        k += static_cast<int>(std::min(behind_best, 1e6));
        continue;
      }
      before = ahead(k);
      if (k == 0 && before <= 0) take_if_better(hit_end(branch, false, point_mm), 0);
      for (int part = 0; part < station.parts; ++part, before = behind) {
        const double low = static_cast<double>(part) / station.parts,
                     high = static_cast<double>(part + 1) / station.parts;
        behind = part + 1 == station.parts
                     ? ahead(k + 1)
                     : growth(branch.pieces[static_cast<std::size_t>(k)], high, point_mm);
        if (before >= 0 && behind <= 0)
          take_if_better(hit_piece(branch, k, {low, high, before, behind}, point_mm), k);
      }
      ++k;
      if (k == last && before >= 0) take_if_better(hit_end(branch, true, point_mm), last - 1);
    }
  }
  best.blend_mm = branch.blend_mm;
  return best;
}

LumenDistanceField::Hit LumenDistanceField::hit_end(const Branch& branch, bool is_last,
                                                    const Vector3d& point_mm) {
  const Station& end = is_last ? branch.stations.back() : branch.stations.front();
  const Vector3d offset = point_mm - end.centre_mm;
  const double distance = rounded_length(offset);
  const double arc_mm = is_last ? branch.step_mm * static_cast<double>(branch.stations.size() - 1) : 0;
  return {end.radius_mm, arc_mm, -offset / distance, {distance, Vector3d::Zero(), -1}};
}

LumenDistanceField::Hit LumenDistanceField::hit_piece(const Branch& branch, int index, const Bracket& bracket,
                                                      const Vector3d& point_mm) {
  const Piece& cubic = branch.pieces[static_cast<std::size_t>(index)];
  auto [low, high, before, behind] = bracket;
  // The sphere that reaches furthest around the point: Newton's method, kept to where it has to lie, for
  // where the clearance no longer grows. There its gradient is that of the distance to the sphere's centre.
  double t = low + (high - low) * (before > behind ? before / (before - behind) : 0.5);
  for (int k = 0;; ++k) {
    const Vector3d offset = point_mm - cubic.centre_mm(t), along = cubic.along(t);
    const double distance = rounded_length(offset);
    const double lag = offset.dot(along), widening = cubic.widening(t);
    const double change = offset.dot(cubic.turning(t)) - along.squaredNorm() +
                          distance * cubic.widening_change(t) - lag / distance * widening;
    const double growth = lag + distance * widening;
    (growth > 0 ? low : high) = t;
    double to = t - growth / change;
    if (!(change < 0 && to >= low && to <= high)) to = 0.5 * (low + high);
    constexpr double kClose = 1e-5;  // its square is what the clearance is off
    constexpr int kIterations = 12;
    if (std::abs(to - t) >= kClose && k < kIterations) {
      t = to;
      continue;
    }
    const Vector3d gradient = -offset / distance;
    return {cubic.radius_mm(t),
            branch.step_mm * (index + t),
            gradient,
            {distance, along - gradient.dot(along) * gradient, change}};
  }
}

double LumenDistanceField::highest_value_mm(const Branch& branch, const Vector3d& point_mm) const {
  const Vector3d nearest = point_mm.cwiseMax(branch.lower_mm).cwiseMin(branch.upper_mm);
  return branch.widest_mm - (point_mm - nearest).norm();
}

int LumenDistanceField::guess(int index, int joint, const Vector3d& point_mm) const {
  const Branch& branch = branches_[static_cast<std::size_t>(index)];
  const double away_mm = (point_mm - joints_[static_cast<std::size_t>(joint)].position_mm).norm();
  const int steps = static_cast<int>(std::min(away_mm / branch.step_mm, 1e6));
  return branch.start_joint == joint ? steps : static_cast<int>(branch.stations.size()) - 2 - steps;
}

LumenDistanceField::Sample LumenDistanceField::at(const Vector3d& point_mm, const Place& from) const {
  const Hit own = hit(from.branch, from.segment, point_mm);
  if (!near_joint(branches_[static_cast<std::size_t>(from.branch)], point_mm))
    return sample(own.value_mm(), own.gradient, own);
  std::array<Hit, kMaxHits> hits;
  std::array<std::size_t, kMaxHits> reached_as;
  std::size_t count = 0;
  reached_as[count] = 0;
  hits[count++] = own;

  // The branches that meet it nearby, and those that meet these nearby.
  struct Reached {
    int branch, joint;
    double wall_mm;  // the wall that lies between it and the first one
    Vector3d wall_slope;
    Matrix3d wall_curvature;
  };
  std::array<Reached, kMaxReached> reached;
  std::size_t reached_count = 0;
  reached[reached_count++] = {from.branch, -1, 0, Vector3d::Zero(), Matrix3d::Zero()};
  for (std::size_t r = 0; r < reached_count; ++r) {
    const Branch& branch = branches_[static_cast<std::size_t>(reached[r].branch)];
    for (const int joint_index : {branch.start_joint, branch.end_joint}) {
      if (joint_index < 0 || joint_index == reached[r].joint) continue;
      const Joint& joint = joints_[static_cast<std::size_t>(joint_index)];
      const Vector3d offset = point_mm - joint.position_mm;
      if (offset.squaredNorm() >= joint.reach_mm * joint.reach_mm) continue;
      Reached next = reached[r];
      next.joint = joint_index;
      if (const double beyond_mm = offset.norm() - joint.parting_mm; beyond_mm > 0) {
        // Without bound at the end of the joint's reach, so that no wall jumps there.
        const double span_mm = joint.reach_mm - joint.parting_mm, t = beyond_mm / span_mm, left = 1 - t;
        next.wall_mm += 0.5 * span_mm * t * t / left;
        const double slope = 0.5 * t * (2 - t) / (left * left), away_mm = offset.norm();
        const Vector3d away = offset / away_mm;
        next.wall_slope += slope * away;
        next.wall_curvature +=
            slope / away_mm * Matrix3d::Identity() +
            (1 / (span_mm * left * left * left) - slope / away_mm) * away * away.transpose();
      }
      for (const int other : joint.branches) {
        if (other == reached[r].branch || reached_count == kMaxReached) continue;
        next.branch = other;
        reached[reached_count++] = next;
        const Branch& vessel = branches_[static_cast<std::size_t>(other)];
        if (count == kMaxHits || highest_value_mm(vessel, point_mm) - next.wall_mm <
                                     hits[0].value_mm() - 0.5 * (hits[0].blend_mm + vessel.blend_mm))
          continue;
        reached_as[count] = reached_count - 1;
        hits[count] = hit(other, guess(other, joint_index, point_mm), point_mm);
        hits[count++].wall_mm = next.wall_mm;
      }
    }
  }

  // A maximum that is rounded where others come within a blend of it: the highest mean of the values, whose
  // weights pay for being uneven. Its gradient is their gradients' mean, and does not jump where the highest
  // changes, however many meet.
  std::array<double, kMaxHits> raised;
  for (std::size_t h = 0; h < count; ++h) raised[h] = hits[h].value_mm() + 0.5 * hits[h].blend_mm;
  double level = -std::numeric_limits<double>::infinity();
  for (bool settled = false; !settled;) {
    double sum_mm = -1, give = 0;
    for (std::size_t h = 0; h < count; ++h)
      if (raised[h] > level) {
        sum_mm += raised[h] / hits[h].blend_mm;
        give += 1 / hits[h].blend_mm;
      }
    settled = !(sum_mm / give > level);
    level = std::max(level, sum_mm / give);
  }
  double clearance = 0, softness = 0;
  Vector3d gradient = Vector3d::Zero(), level_gradient = Vector3d::Zero();
  Matrix3d curvature = Matrix3d::Zero();
  std::size_t best = 0;
  for (std::size_t h = 0; h < count; ++h) {
    if (hits[h].value_mm() > hits[best].value_mm()) best = h;
    if (raised[h] <= level) continue;
    const double weight = (raised[h] - level) / hits[h].blend_mm;
    const Reached& between = reached[reached_as[h]];
    curvature += weight * (hits[h].rounding.curvature(hits[h].gradient) + between.wall_curvature);
    hits[h].gradient -= between.wall_slope;
    clearance += weight * (hits[h].value_mm() + 0.5 * hits[h].blend_mm * (1 - weight));
    gradient += weight * hits[h].gradient;
    softness += 1 / hits[h].blend_mm;
    level_gradient += hits[h].gradient / hits[h].blend_mm;
  }
  level_gradient /= softness;
  for (std::size_t h = 0; h < count; ++h)
    if (raised[h] > level) {
      const Vector3d apart = hits[h].gradient - level_gradient;
      curvature -= apart * apart.transpose() / hits[h].blend_mm;
    }
  Sample blended = sample(clearance, gradient, hits[best]);
  blended.wall = curvature;
  return blended;
}

LumenDistanceField::Sample LumenDistanceField::sample(double clearance_mm, const Vector3d& gradient,
                                                      const Hit& hit) const {
  const Branch& branch = branches_[static_cast<std::size_t>(hit.place.branch)];
  return {clearance_mm,
          gradient,
          hit.radius_mm,
          hit.place,
          std::clamp(hit.arc_mm - branch.arc_offset_mm, 0.0, branch.arc_length_mm),
          hit.rounding};
}

bool LumenDistanceField::near_joint(const Branch& branch, const Vector3d& point_mm) const {
  return std::ranges::any_of(std::array{branch.start_joint, branch.end_joint}, [&](int index) {
    if (index < 0) return false;
    const Joint& joint = joints_[static_cast<std::size_t>(index)];
    return (point_mm - joint.position_mm).squaredNorm() < joint.reach_mm * joint.reach_mm;
  });
}

LumenDistanceField::Place LumenDistanceField::locate(const Vector3d& point_mm) const {
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
