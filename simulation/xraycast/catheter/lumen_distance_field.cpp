#include "xraycast/catheter/lumen_distance_field.hpp"

#include "xraycast/base/wide_vectors.hpp"
#include "xraycast/mechanics/lanes.hpp"
#include "xraycast/mechanics/vectors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace xraycast {
namespace {

using Eigen::Matrix3d, Eigen::Vector3d;

// Softens the cone that the distance to a centreline has there; a hundredth of it is left 2 mm away.
constexpr double kSoftening_mm = 0.02;
constexpr double kMaxBlend_mm = 0.5;
// How far outside the lumen the search still looks for several local maxima.
constexpr double kBeyondWall_mm = 1;
// How many branches may lie within reach of one point, and how many of them around it.
constexpr std::size_t kMaxReached = 64, kMaxCandidates = 16;
// Between stations, of the narrowest radius.
constexpr double kMinStep_mm = 0.5, kMaxStep_mm = 1.5, kStepPerRadius = 0.5;

double softened_length(const Vector3d& v) {
  return std::sqrt(v.squaredNorm() + kSoftening_mm * kSoftening_mm);
}

}  // namespace

// ---- construction ---------------------------------------------------------------------------------------

LumenDistanceField::LumenDistanceField(const VesselTree& tree, const VesselEnd* opening,
                                       double opening_length_mm) {
  const auto& vessels = tree.branches();
  std::vector<Branch> branches;
  for (int i = 0; i < static_cast<int>(vessels.size()); ++i)
    branches.push_back(branch_of(vessels[static_cast<std::size_t>(i)],
                                 opening && opening->branch == i ? opening : nullptr, opening_length_mm));
  for (int i = 0; i < static_cast<int>(vessels.size()); ++i)
    if (const auto& children = vessels[static_cast<std::size_t>(i)].children; !children.empty())
      add_bifurcation(branches, i, children);
  for (Branch& branch : branches) branches_.push_back(std::make_shared<const Branch>(std::move(branch)));
}

/// A vessel's points at even steps, as fine as its radius requires.
std::vector<VesselPoint> LumenDistanceField::resampled(const VesselBranch& vessel) {
  double min_radius_mm = std::numeric_limits<double>::infinity();
  for (const VesselPoint& point : vessel.points) min_radius_mm = std::min(min_radius_mm, point.radius_mm);
  const double length_mm = vessel.arc_length_mm.back();
  const double step_mm = std::clamp(kStepPerRadius * min_radius_mm, kMinStep_mm, kMaxStep_mm);
  const int pieces = std::max(1, static_cast<int>(std::lround(length_mm / step_mm)));
  std::vector<VesselPoint> points;
  std::size_t k = 0;
  for (int i = 0; i <= pieces; ++i) {
    const double arc_mm = length_mm * i / pieces;
    while (k + 2 < vessel.points.size() && vessel.arc_length_mm[k + 1] < arc_mm) ++k;
    const double fraction = std::clamp(
        (arc_mm - vessel.arc_length_mm[k]) / (vessel.arc_length_mm[k + 1] - vessel.arc_length_mm[k]), 0.0,
        1.0);
    const VesselPoint &from = vessel.points[k], &to = vessel.points[k + 1];
    points.push_back({from.position_mm + fraction * (to.position_mm - from.position_mm),
                      std::lerp(from.radius_mm, to.radius_mm, fraction)});
  }
  return points;
}

LumenDistanceField::Branch LumenDistanceField::branch_of(const VesselBranch& vessel, const VesselEnd* opening,
                                                         double opening_length_mm) {
  Branch branch;
  branch.blend_mm = kMaxBlend_mm;
  std::vector<VesselPoint> points = resampled(vessel);
  branch.arc_length_mm = vessel.arc_length_mm.back();
  branch.step_mm = branch.arc_length_mm / static_cast<double>(points.size() - 1);
  if (opening) {
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
  branch.lower_mm = branch.upper_mm = to_eigen(points.front().position_mm);
  std::vector<double> radii_mm;
  for (std::size_t k = 0; k <= last; ++k) {
    const glm::dvec3 along =
        points[std::min(k + 1, last)].position_mm - points[k > 0 ? k - 1 : 0].position_mm;
    branch.stations.push_back({to_eigen(points[k].position_mm), to_eigen(along).normalized(), 0, 0});
    branch.lower_mm = branch.lower_mm.cwiseMin(branch.stations.back().centre_mm);
    branch.upper_mm = branch.upper_mm.cwiseMax(branch.stations.back().centre_mm);
    radii_mm.push_back(points[k].radius_mm);
  }
  take_radii(branch, radii_mm);
  return branch;
}

/// And makes the pieces between stations of them.
void LumenDistanceField::take_radii(Branch& branch, std::span<const double> radii_mm) {
  const std::size_t last = branch.stations.size() - 1;
  branch.max_radius_mm = branch.max_change_mm = 0;
  branch.pieces.clear();
  for (std::size_t k = 0; k <= last; ++k) {
    Station& station = branch.stations[k];
    station = {station.centre_mm, station.tangent, radii_mm[k],
               k > 0 && k < last ? 0.5 * (radii_mm[k + 1] - radii_mm[k - 1]) : 0};
    branch.max_radius_mm = std::max(branch.max_radius_mm, station.radius_mm);
  }
  add_pieces(branch);
}

int LumenDistanceField::station_count(int branch) const {
  return static_cast<int>(branch_at(branch).stations.size());
}

double LumenDistanceField::station_arc_mm(int branch, int station) const {
  return branch_at(branch).step_mm * station - branch_at(branch).arc_offset_mm;
}

double LumenDistanceField::station_radius_mm(int branch, int station) const {
  return branch_at(branch).stations[static_cast<std::size_t>(station)].radius_mm;
}

LumenDistanceField LumenDistanceField::with_radii(int branch, std::span<const double> radii_mm) const {
  Branch changed = branch_at(branch);
  take_radii(changed, radii_mm);
  LumenDistanceField field = *this;
  field.branches_[static_cast<std::size_t>(branch)] = std::make_shared<const Branch>(std::move(changed));
  return field;
}

void LumenDistanceField::add_bifurcation(std::vector<Branch>& branches, int parent,
                                         const std::vector<int>& children) {
  const auto index = static_cast<int>(bifurcations_.size());
  Branch& stem = branches[static_cast<std::size_t>(parent)];
  stem.end_bifurcation = index;
  Bifurcation bifurcation;
  bifurcation.position_mm = stem.stations.back().centre_mm;
  bifurcation.branches.push_back(parent);
  double max_radius_mm = stem.stations.back().radius_mm, min_radius_mm = max_radius_mm;
  for (const int child : children) {
    Branch& branch = branches[static_cast<std::size_t>(child)];
    branch.start_bifurcation = index;
    bifurcation.branches.push_back(child);
    max_radius_mm = std::max(max_radius_mm, branch.stations.front().radius_mm);
    min_radius_mm = std::min(min_radius_mm, branch.stations.front().radius_mm);
  }
  // At 30 degrees two tubes of one width part at 4 radii from where their centrelines meet.
  bifurcation.merge_radius_mm = 4 * max_radius_mm;
  bifurcation.search_radius_mm = 6 * max_radius_mm;
  for (const int branch : bifurcation.branches) {
    double& blend_mm = branches[static_cast<std::size_t>(branch)].blend_mm;
    blend_mm = std::min(blend_mm, 0.25 * min_radius_mm);
  }
  bifurcations_.push_back(std::move(bifurcation));
}

LumenDistanceField::Piece LumenDistanceField::piece_from(const Branch& branch, std::size_t station) {
  const Station &a = branch.stations[station], &b = branch.stations[station + 1];
  const Vector3d chord = b.centre_mm - a.centre_mm;
  const double step_mm = branch.step_mm, radius_change = b.radius_mm - a.radius_mm;
  return {a.centre_mm,
          step_mm * a.tangent,
          3 * chord - step_mm * (2 * a.tangent + b.tangent),
          step_mm * (a.tangent + b.tangent) - 2 * chord,
          a.radius_mm,
          a.radius_slope_mm,
          3 * radius_change - 2 * a.radius_slope_mm - b.radius_slope_mm,
          a.radius_slope_mm + b.radius_slope_mm - 2 * radius_change};
}

void LumenDistanceField::add_pieces(Branch& branch) {
  for (std::size_t k = 0; k + 1 < branch.stations.size(); ++k) {
    branch.pieces.push_back(piece_from(branch, k));
    mark_folds(branch, k);
  }
}

/// Finds out whether the clearance may have more than one local maximum along a piece.
void LumenDistanceField::mark_folds(Branch& branch, std::size_t index) {
  // Into so many parts such a piece is cut. Two maxima in one part are missed still, but differ the less the
  // shorter it is, by its third power.
  constexpr int kParts = 16;
  auto& stations = branch.stations;
  const Piece& piece = branch.pieces[index];
  // A derivative stays in the hull of its Bezier points, and so within these bounds all along the piece.
  const std::array derivatives{piece.derivative(0), Vector3d(piece.linear + piece.quadratic),
                               piece.derivative(1)};
  const std::array radius_slopes{piece.radius_slope(0), piece.radius_linear + piece.radius_quadratic,
                                 piece.radius_slope(1)};
  const Vector3d forwards = (derivatives[0] + derivatives[1] + derivatives[2]).normalized();
  double bending = 0, min_speed = branch.step_mm, max_speed = 0, max_radius_slope = 0;
  for (const double t : {0.0, 1.0})
    bending = std::max(bending, piece.second_derivative(t).norm() + std::abs(piece.radius_slope_change(t)));
  for (std::size_t i = 0; i < derivatives.size(); ++i) {
    min_speed = std::clamp(derivatives[i].dot(forwards), 0.0, min_speed);
    max_speed = std::max(max_speed, derivatives[i].norm());
    max_radius_slope = std::max(max_radius_slope, std::abs(radius_slopes[i]));
  }
  branch.max_change_mm = std::max(branch.max_change_mm, max_speed + max_radius_slope);
  const double reach_mm = std::max(stations[index].radius_mm, stations[index + 1].radius_mm) + kBeyondWall_mm;
  if (bending * reach_mm < min_speed * min_speed - max_radius_slope * max_radius_slope) return;
  stations[index].parts = kParts;
  // Whatever lies this side of the wall on both sides of the bend.
  const int k = static_cast<int>(index), last = static_cast<int>(stations.size()) - 1;
  const int nearby = static_cast<int>(std::ceil(2 * reach_mm / branch.step_mm));
  for (int i = std::max(0, k - nearby); i <= std::min(last, k + nearby); ++i) {
    int& fold_reach = stations[static_cast<std::size_t>(i)].fold_reach;
    fold_reach = std::max(fold_reach, 2 * nearby);
  }
}

// ---- one branch -----------------------------------------------------------------------------------------

/// Above zero where the spheres further along the branch reach further beyond the point.
double LumenDistanceField::clearance_slope(const Branch& branch, int index, const Vector3d& point_mm) {
  const Station& station = branch.stations[static_cast<std::size_t>(index)];
  const Vector3d offset = point_mm - station.centre_mm;
  const double along = offset.dot(station.tangent) * branch.step_mm;
  return station.radius_slope_mm == 0 ? along : along + softened_length(offset) * station.radius_slope_mm;
}

double LumenDistanceField::clearance_slope(const Piece& piece, double t, const Vector3d& point_mm) {
  const Vector3d offset = point_mm - piece.centre_mm(t);
  return offset.dot(piece.derivative(t)) + softened_length(offset) * piece.radius_slope(t);
}

/// Uphill from where the search starts, to the piece on which the clearance turns round.
LumenDistanceField::Place LumenDistanceField::find_place(const Branch& branch, int from,
                                                         const Vector3d& point_mm) {
  const int last = static_cast<int>(branch.stations.size()) - 1;
  int i = std::clamp(from, 0, last - 1);
  double before = clearance_slope(branch, i, point_mm), after = clearance_slope(branch, i + 1, point_mm);
  while (after > 0 && i + 1 < last) {
    ++i;
    before = after;
    after = clearance_slope(branch, i + 1, point_mm);
  }
  while (before < 0 && i > 0) {
    --i;
    after = before;
    before = clearance_slope(branch, i, point_mm);
  }
  return {i, before <= 0 && i == 0, after >= 0 && i + 1 == last, {0, 1, before, after}};
}

LumenDistanceField::Projection LumenDistanceField::project(int index, int from,
                                                           const Vector3d& point_mm) const {
  const Branch& branch = branch_at(index);
  const Place place = find_place(branch, from, point_mm);
  Projection best = place.is_end() ? project_onto_end(branch, !place.is_first_end, point_mm)
                                   : project_onto_piece(branch, place.piece, place.bracket, point_mm);
  complete(index, place, point_mm, best);
  return best;
}

/// What a projection onto a place lacks.
void LumenDistanceField::complete(int index, const Place& place, const Vector3d& point_mm,
                                  Projection& best) const {
  const Branch& branch = branch_at(index);
  best.hint = {index, place.piece};
  search_folds(branch, place.piece, point_mm, best);
  best.blend_mm = branch.blend_mm;
}

/// On the inner side of a sharp bend the clearance has several local maxima along the branch: takes the
/// highest.
void LumenDistanceField::search_folds(const Branch& branch, int segment, const Vector3d& point_mm,
                                      Projection& best) {
  const int nearby = branch.stations[static_cast<std::size_t>(segment)].fold_reach;
  if (nearby == 0) return;
  const int last = static_cast<int>(branch.stations.size()) - 1;
  const auto take_if_better = [&](const Projection& other, int k) {
    if (other.clearance_mm() <= best.clearance_mm()) return;
    const int index = best.hint.branch;
    best = other;
    best.hint = {index, k};
  };
  const int first = std::max(0, segment - nearby), end = std::min(last, segment + 1 + nearby);
  for (int k = first; k < end;) {
    // So far on that none before it can be better.
    const Station& station = branch.stations[static_cast<std::size_t>(k)];
    const double clearance_mm = station.radius_mm - softened_length(point_mm - station.centre_mm);
    const double skipped = (best.clearance_mm() - clearance_mm) / branch.max_change_mm;
    if (skipped > 1) {
      k += static_cast<int>(std::min(skipped, 1e6));
      continue;
    }
    double before = clearance_slope(branch, k, point_mm);
    if (k == 0 && before <= 0) take_if_better(project_onto_end(branch, false, point_mm), 0);
    double after = before;
    for (int part = 0; part < station.parts; ++part, before = after) {
      const double low = static_cast<double>(part) / station.parts,
                   high = static_cast<double>(part + 1) / station.parts;
      after = part + 1 == station.parts
                  ? clearance_slope(branch, k + 1, point_mm)
                  : clearance_slope(branch.pieces[static_cast<std::size_t>(k)], high, point_mm);
      if (before >= 0 && after <= 0)
        take_if_better(project_onto_piece(branch, k, {low, high, before, after}, point_mm), k);
    }
    ++k;
    if (k == last && before >= 0) take_if_better(project_onto_end(branch, true, point_mm), last - 1);
  }
}

LumenDistanceField::Projection LumenDistanceField::project_onto_end(const Branch& branch, bool is_last,
                                                                    const Vector3d& point_mm) {
  const Station& end = is_last ? branch.stations.back() : branch.stations.front();
  const Vector3d offset = point_mm - end.centre_mm;
  const double distance = softened_length(offset);
  const double arc_mm = is_last ? branch.step_mm * static_cast<double>(branch.stations.size() - 1) : 0;
  return {end.radius_mm, arc_mm, -offset / distance, {distance, Vector3d::Zero(), -1}};
}

/// The cubics of one piece or of four.
template <typename Real>
struct LumenDistanceField::Pieces {
  Triple<Real> start_mm, linear, quadratic, cubic;
  Real start_radius_mm, radius_linear, radius_quadratic, radius_cubic;

  [[gnu::always_inline]] static Pieces of(const LaneSources<Real, Piece>& from) {
    return {gathered_triple<Real, Piece>(
                from, [](const Piece& p) -> auto& { return p.start_mm; }),
            gathered_triple<Real, Piece>(
                from, [](const Piece& p) -> auto& { return p.linear; }),
            gathered_triple<Real, Piece>(
                from, [](const Piece& p) -> auto& { return p.quadratic; }),
            gathered_triple<Real, Piece>(
                from, [](const Piece& p) -> auto& { return p.cubic; }),
            gathered<Real, Piece>(from, [](const Piece& p) { return p.start_radius_mm; }),
            gathered<Real, Piece>(from, [](const Piece& p) { return p.radius_linear; }),
            gathered<Real, Piece>(from, [](const Piece& p) { return p.radius_quadratic; }),
            gathered<Real, Piece>(from, [](const Piece& p) { return p.radius_cubic; })};
  }
};

/// The maximum of the clearance over one piece or four.
template <typename Real>
struct LumenDistanceField::PieceProjections {
  Real t, radius_mm, distance_mm, slope_change;
  Triple<Real> gradient, transverse;

  /// Newton's method on the clearance's slope, safeguarded by bisection. At the maximum the gradient is that
  /// of the distance to the sphere's centre.
  [[gnu::always_inline]] PieceProjections(const Pieces<Real>& piece, Real low, Real high, Real before,
                                          Real after, const Triple<Real>& point_mm) {
    constexpr double kClose = 1e-5;  // its square is the error of the clearance
    constexpr int kMaxIterations = 12;
    t = low + (high - low) * choose(before > after, before / (before - after), all<Real>(0.5));
    for (int k = 0;; ++k) {
      const Triple<Real> half_bend = piece.quadratic + (3.0 * t) * piece.cubic;
      const Triple<Real> offset =
          point_mm - (piece.start_mm + t * (piece.linear + t * (piece.quadratic + t * piece.cubic)));
      const Triple<Real> derivative = piece.linear + t * (piece.quadratic + half_bend);
      const Real radius_half_bend = piece.radius_quadratic + 3.0 * t * piece.radius_cubic;
      const Real radius_slope = piece.radius_linear + t * (piece.radius_quadratic + radius_half_bend);
      distance_mm = square_root(dot(offset, offset) + kSoftening_mm * kSoftening_mm);
      const Real along = dot(offset, derivative), by_distance = 1.0 / distance_mm;
      const Real slope = along + distance_mm * radius_slope;
      slope_change = 2.0 * (dot(offset, half_bend) + distance_mm * radius_half_bend) -
                     dot(derivative, derivative) - along * by_distance * radius_slope;
      low = choose(slope > 0.0, t, low);
      high = choose(slope > 0.0, high, t);
      Real next = t - slope / slope_change;
      next = choose((slope_change < 0.0) & (next >= low) & (next <= high), next, 0.5 * (low + high));
      // What has converged stays as it is while others go on.
      const auto is_off = magnitude(next - t) >= kClose;
      if (any(is_off) && k < kMaxIterations) {
        t = choose(is_off, next, t);
        continue;
      }
      radius_mm = piece.start_radius_mm +
                  t * (piece.radius_linear + t * (piece.radius_quadratic + t * piece.radius_cubic));
      gradient = -by_distance * offset;
      transverse = derivative - dot(gradient, derivative) * gradient;
      return;
    }
  }

  [[gnu::always_inline]] Projection lane_projection(const Branch& branch, int piece, std::size_t k) const {
    return {lane(radius_mm, k),
            branch.step_mm * (piece + lane(t, k)),
            lane_vector<Vector3d>(gradient, k),
            {lane(distance_mm, k), lane_vector<Vector3d>(transverse, k), lane(slope_change, k)}};
  }
};

LumenDistanceField::Projection LumenDistanceField::project_onto_piece(const Branch& branch, int index,
                                                                      const Bracket& bracket,
                                                                      const Vector3d& point_mm) {
  const auto& [low, high, before, after] = bracket;
  const PieceProjections<double> projection(
      Pieces<double>::of({&branch.pieces[static_cast<std::size_t>(index)]}), low, high, before, after,
      {point_mm.x(), point_mm.y(), point_mm.z()});
  return projection.lane_projection(branch, index, 0);
}

// ---- many points ----------------------------------------------------------------------------------------

/// Queries that end on a piece of their branch.
struct LumenDistanceField::Group {
  std::array<const Query*, kLanes> queries;
  std::array<Place, kLanes> places;
  std::size_t count = 0;
};

XRAYCAST_WIDE_VECTORS
void LumenDistanceField::sample_group(const Group& group) const {
  // The first one fills up the lanes.
  LaneSources<Lanes, Query> queries;
  LaneSources<Lanes, Bracket> brackets;
  LaneSources<Lanes, Piece> pieces;
  for (std::size_t k = 0; k < kLanes; ++k) {
    const std::size_t from = k < group.count ? k : 0;
    queries[k] = group.queries[from];
    brackets[k] = &group.places[from].bracket;
    pieces[k] =
        &branch_at(queries[k]->from.branch).pieces[static_cast<std::size_t>(group.places[from].piece)];
  }
  const PieceProjections<Lanes> projections(
      Pieces<Lanes>::of(pieces), gathered<Lanes, Bracket>(brackets, [](const Bracket& b) { return b.low; }),
      gathered<Lanes, Bracket>(brackets, [](const Bracket& b) { return b.high; }),
      gathered<Lanes, Bracket>(brackets, [](const Bracket& b) { return b.slope_low; }),
      gathered<Lanes, Bracket>(brackets, [](const Bracket& b) { return b.slope_high; }),
      gathered_triple<Lanes, Query>(
          queries, [](const Query& q) -> auto& { return q.point_mm; }));
  for (std::size_t k = 0; k < group.count; ++k) {
    const Query& query = *group.queries[k];
    const Branch& branch = branch_at(query.from.branch);
    Projection own = projections.lane_projection(branch, group.places[k].piece, k);
    complete(query.from.branch, group.places[k], query.point_mm, own);
    *query.sample = with_neighbours(own, query.point_mm);
  }
}

void LumenDistanceField::sample(std::span<const Query> queries) const {
  Group group;
  for (const Query& query : queries) {
    const Place place = find_place(branch_at(query.from.branch), query.from.segment, query.point_mm);
    if (place.is_end()) {
      *query.sample = at(query.point_mm, query.from);
      continue;
    }
    group.queries[group.count] = &query;
    group.places[group.count] = place;
    if (++group.count < kLanes) continue;
    sample_group(group);
    group.count = 0;
  }
  if (group.count > 0) sample_group(group);
}

// ---- several branches -----------------------------------------------------------------------------------

/// The branches that may hold a point, the one that was searched first in front.
struct LumenDistanceField::Candidates {
  struct Candidate {
    Projection projection;
    Separation separation;
  };
  std::array<Candidate, kMaxCandidates> list;
  std::size_t count = 0;

  void add(const Projection& projection, const Separation& separation) {
    list[count] = {projection, separation};
    list[count++].projection.separation_mm = separation.distance_mm;
  }
};

LumenDistanceField::Sample LumenDistanceField::at(const Vector3d& point_mm, const SearchHint& from) const {
  return with_neighbours(project(from.branch, from.segment, point_mm), point_mm);
}

LumenDistanceField::Sample LumenDistanceField::with_neighbours(const Projection& own,
                                                               const Vector3d& point_mm) const {
  const int branch = own.hint.branch;
  if (!near_bifurcation(branch_at(branch), point_mm)) return sample_of(own.clearance_mm(), own.gradient, own);
  Candidates candidates;
  candidates.add(own, {0, Vector3d::Zero(), Matrix3d::Zero()});
  add_neighbours(branch, point_mm, candidates);
  return blended(candidates);
}

bool LumenDistanceField::near_bifurcation(const Branch& branch, const Vector3d& point_mm) const {
  for (const int index : {branch.start_bifurcation, branch.end_bifurcation}) {
    if (index < 0) continue;
    const Bifurcation& bifurcation = bifurcations_[static_cast<std::size_t>(index)];
    if ((point_mm - bifurcation.position_mm).squaredNorm() <
        bifurcation.search_radius_mm * bifurcation.search_radius_mm)
      return true;
  }
  return false;
}

/// Breadth first: the branches that meet the first one nearby, and those that meet these nearby.
void LumenDistanceField::add_neighbours(int own_branch, const Vector3d& point_mm,
                                        Candidates& candidates) const {
  struct Reached {
    int branch, bifurcation;
    Separation separation;
  };
  std::array<Reached, kMaxReached> reached;
  std::size_t count = 0;
  reached[count++] = {own_branch, -1, candidates.list[0].separation};
  for (std::size_t r = 0; r < count; ++r) {
    const Branch& branch = branch_at(reached[r].branch);
    for (const int index : {branch.start_bifurcation, branch.end_bifurcation}) {
      if (index < 0 || index == reached[r].bifurcation) continue;
      const Bifurcation& bifurcation = bifurcations_[static_cast<std::size_t>(index)];
      if ((point_mm - bifurcation.position_mm).squaredNorm() >=
          bifurcation.search_radius_mm * bifurcation.search_radius_mm)
        continue;
      Reached next = reached[r];
      next.bifurcation = index;
      separate(bifurcation, point_mm, next.separation);
      for (const int other : bifurcation.branches) {
        if (other == reached[r].branch || count == kMaxReached) continue;
        next.branch = other;
        reached[count++] = next;
        // Projected onto only where it can take part in the blend.
        const Branch& vessel = branch_at(other);
        const Projection& own = candidates.list[0].projection;
        if (candidates.count == kMaxCandidates ||
            max_clearance_mm(vessel, point_mm) - next.separation.distance_mm <
                own.clearance_mm() - 0.5 * (own.blend_mm + vessel.blend_mm))
          continue;
        candidates.add(project(other, start_station(other, index, point_mm), point_mm), next.separation);
      }
    }
  }
}

/// Adds what a bifurcation separates its branches by at a point. It grows without bound towards the end of
/// the search radius, so that no wall jumps there.
void LumenDistanceField::separate(const Bifurcation& bifurcation, const Vector3d& point_mm,
                                  Separation& separation) {
  const Vector3d offset = point_mm - bifurcation.position_mm;
  const double away_mm = offset.norm(), beyond_mm = away_mm - bifurcation.merge_radius_mm;
  if (!(beyond_mm > 0)) return;
  const double span_mm = bifurcation.search_radius_mm - bifurcation.merge_radius_mm, t = beyond_mm / span_mm,
               left = 1 - t;
  const double slope = 0.5 * t * (2 - t) / (left * left);
  const Vector3d direction = offset / away_mm;
  separation.distance_mm += 0.5 * span_mm * t * t / left;
  separation.gradient += slope * direction;
  separation.hessian +=
      slope / away_mm * Matrix3d::Identity() +
      (1 / (span_mm * left * left * left) - slope / away_mm) * direction * direction.transpose();
}

/// An upper bound.
double LumenDistanceField::max_clearance_mm(const Branch& branch, const Vector3d& point_mm) {
  const Vector3d nearest = point_mm.cwiseMax(branch.lower_mm).cwiseMin(branch.upper_mm);
  return branch.max_radius_mm - (point_mm - nearest).norm();
}

/// Where to start the search in a branch: as far from the bifurcation as the point is.
int LumenDistanceField::start_station(int index, int bifurcation, const Vector3d& point_mm) const {
  const Branch& branch = branch_at(index);
  const double away_mm = (point_mm - bifurcations_[static_cast<std::size_t>(bifurcation)].position_mm).norm();
  const int steps = static_cast<int>(std::min(away_mm / branch.step_mm, 1e6));
  return branch.start_bifurcation == bifurcation ? steps
                                                 : static_cast<int>(branch.stations.size()) - 2 - steps;
}

/// A smooth maximum where others come within a blend of the highest: the highest mean of the clearances,
/// whose weights are penalised for being uneven. Its gradient is the gradients' mean, and does not jump where
/// the highest changes, however many meet.
LumenDistanceField::Sample LumenDistanceField::blended(const Candidates& candidates) const {
  const std::size_t count = candidates.count;
  // A candidate's weight is what its raised clearance has above a level, over its blend; the level is where
  // the weights sum up to one.
  std::array<double, kMaxCandidates> raised;
  for (std::size_t c = 0; c < count; ++c) {
    const Projection& p = candidates.list[c].projection;
    raised[c] = p.clearance_mm() + 0.5 * p.blend_mm;
  }
  double level = -std::numeric_limits<double>::infinity();
  for (bool is_settled = false; !is_settled;) {
    double weighted_mm = -1, weights = 0;
    for (std::size_t c = 0; c < count; ++c)
      if (raised[c] > level) {
        const double blend_mm = candidates.list[c].projection.blend_mm;
        weighted_mm += raised[c] / blend_mm;
        weights += 1 / blend_mm;
      }
    is_settled = !(weighted_mm / weights > level);
    level = std::max(level, weighted_mm / weights);
  }

  double clearance_mm = 0, softness = 0;
  Vector3d gradient = Vector3d::Zero(), level_gradient = Vector3d::Zero();
  Matrix3d curvature = Matrix3d::Zero();
  std::array<Vector3d, kMaxCandidates> gradients;
  std::size_t best = 0;
  for (std::size_t c = 0; c < count; ++c) {
    const auto& [p, separation] = candidates.list[c];
    if (p.clearance_mm() > candidates.list[best].projection.clearance_mm()) best = c;
    if (raised[c] <= level) continue;
    const double weight = (raised[c] - level) / p.blend_mm;
    gradients[c] = p.gradient - separation.gradient;
    clearance_mm += weight * (p.clearance_mm() + 0.5 * p.blend_mm * (1 - weight));
    gradient += weight * gradients[c];
    curvature += weight * (p.wall.matrix(p.gradient) + separation.hessian);
    softness += 1 / p.blend_mm;
    level_gradient += gradients[c] / p.blend_mm;
  }
  level_gradient /= softness;
  for (std::size_t c = 0; c < count; ++c)
    if (raised[c] > level) {
      const Vector3d apart = gradients[c] - level_gradient;
      curvature -= apart * apart.transpose() / candidates.list[c].projection.blend_mm;
    }
  Sample blended = sample_of(clearance_mm, gradient, candidates.list[best].projection);
  blended.wall = curvature;
  return blended;
}

LumenDistanceField::Sample LumenDistanceField::sample_of(double clearance_mm, const Vector3d& gradient,
                                                         const Projection& projection) const {
  const Branch& branch = branch_at(projection.hint.branch);
  return {clearance_mm,
          gradient,
          projection.radius_mm,
          projection.hint,
          std::clamp(projection.arc_mm - branch.arc_offset_mm, 0.0, branch.arc_length_mm),
          projection.wall};
}

Matrix3d LumenDistanceField::WallCurvature::matrix(const Vector3d& gradient) const {
  const Matrix3d sphere = Matrix3d::Identity() - gradient * gradient.transpose();
  if (!(slope_change < 0)) return sphere / distance_mm;  // at a bend's focus, where it has none
  return (sphere + transverse * transverse.transpose() / slope_change) / distance_mm;
}

Vector3d LumenDistanceField::WallCurvature::times(const Vector3d& gradient, const Vector3d& vector) const {
  const Vector3d by_sphere = vector - gradient.dot(vector) * gradient;
  if (!(slope_change < 0)) return by_sphere / distance_mm;
  return (by_sphere + transverse.dot(vector) / slope_change * transverse) / distance_mm;
}

Matrix3d LumenDistanceField::Sample::curvature() const {
  const WallCurvature* one = std::get_if<WallCurvature>(&wall);
  return one ? one->matrix(gradient) : std::get<Matrix3d>(wall);
}

LumenDistanceField::SearchHint LumenDistanceField::locate(const Vector3d& point_mm) const {
  SearchHint best;
  double clearance_mm = -std::numeric_limits<double>::infinity();
  for (std::size_t b = 0; b < branches_.size(); ++b)
    for (std::size_t k = 0; k < branches_[b]->stations.size(); ++k) {
      const Station& station = branches_[b]->stations[k];
      const double here_mm = station.radius_mm - (point_mm - station.centre_mm).norm();
      if (here_mm <= clearance_mm) continue;
      clearance_mm = here_mm;
      best = {static_cast<int>(b), static_cast<int>(std::min(k, branches_[b]->stations.size() - 2))};
    }
  return best;
}

}  // namespace xraycast
