#include "xraycast/lesions/wall_change.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace xraycast {
namespace {

bool is_same_point(const VesselPoint& a, const VesselPoint& b) {
  return a.position_mm == b.position_mm && a.radius_mm == b.radius_mm;
}

/// How far from its centreline a vessel's lumen is looked for, however uneven its wall.
double reach_mm(double radius_mm) { return 1.5 * radius_mm + 1; }

/// A piece with all that it may move around it.
SegmentIndex::Segment reach_of(const VesselBranch& branch, int number, std::size_t k) {
  const VesselPoint &a = branch.points[k], &b = branch.points[k + 1];
  const double widest_mm = reach_mm(std::max(a.radius_mm, b.radius_mm));
  return {a.position_mm, b.position_mm, widest_mm, widest_mm, number, static_cast<int>(k)};
}

/// The pieces along which the ratio of radii changes, or the centreline moves: elsewhere a wall keeps its
/// shape.
std::vector<char> uneven_pieces(const VesselBranch& was, const VesselBranch& is) {
  const auto ratio = [&](std::size_t k) { return is.points[k].radius_mm / was.points[k].radius_mm; };
  const auto shift = [&](std::size_t k) { return is.points[k].position_mm - was.points[k].position_mm; };
  constexpr double kRounding = 1e-9;
  std::vector<char> uneven(was.points.size() - 1);
  for (std::size_t k = 0; k < uneven.size(); ++k)
    uneven[k] =
        std::abs(ratio(k + 1) - ratio(k)) > kRounding || glm::distance(shift(k + 1), shift(k)) > kRounding;
  return uneven;
}

/// Whether a point is too far from a place for its vessel's lumen.
bool is_beyond(const glm::dvec3& point_mm, const VesselPoint& place) {
  return glm::distance(point_mm, place.position_mm) > reach_mm(place.radius_mm);
}

/// Half a wave of the cosine on either side of the middle: 1 there, 0 at the ends.
double depth_at(const PlacedStenosis& stenosis, double at_mm) {
  const double s = (at_mm - stenosis.at_mm) / stenosis.length_mm;
  return std::abs(s) < 0.5 ? 0.5 * (1 + std::cos(2 * std::numbers::pi * s)) : 0;
}

// ---- points where they are needed -----------------------------------------------------------------------

/// Arc lengths of a stenosis's own points, its middle among them: about as far apart as a fraction of it, or
/// of the vessel's radius in the throat.
std::vector<double> own_places(const PlacedStenosis& stenosis, const VesselBranch& branch) {
  const double throat_mm = point_at(branch, stenosis.at_mm).radius_mm * (1 - stenosis.lost);
  const double finest_mm = std::clamp(std::min(stenosis.length_mm / 32, throat_mm), 0.05, 1.0);
  const int half = std::max(8, static_cast<int>(std::ceil(0.5 * stenosis.length_mm / finest_mm)));
  std::vector<double> places;
  for (int i = -half; i <= half; ++i) places.push_back(stenosis.at_mm + 0.5 * stenosis.length_mm * i / half);
  return places;
}

/// The branch with points added at places; none is added beside one that is there.
VesselBranch with_points_at(const VesselBranch& branch, std::vector<double> places) {
  constexpr double kBeside_mm = 1e-3;
  std::ranges::sort(places);
  VesselBranch finer{
      .points = {}, .parent = branch.parent, .children = {}, .arc_length_mm = {}, .name = branch.name};
  std::size_t next = 0;
  for (std::size_t k = 0; k < branch.points.size(); ++k) {
    const double here_mm = branch.arc_length_mm[k];
    for (; next < places.size() && places[next] < here_mm - kBeside_mm; ++next)
      if (k > 0 && places[next] > branch.arc_length_mm[k - 1] + kBeside_mm)
        finer.points.push_back(point_at(branch, places[next]));
    finer.points.push_back(branch.points[k]);
  }
  return finer;
}

VesselTree with_own_points(const VesselTree& tree, const std::vector<PlacedStenosis>& stenoses) {
  std::vector<VesselBranch> branches = tree.branches();
  for (std::size_t b = 0; b < branches.size(); ++b) {
    std::vector<double> places;
    for (const PlacedStenosis& stenosis : stenoses)
      if (stenosis.branch == static_cast<int>(b))
        for (const double at_mm : own_places(stenosis, branches[b])) places.push_back(at_mm);
    if (!places.empty()) branches[b] = with_points_at(branches[b], std::move(places));
  }
  return VesselTree(std::move(branches), "the edited tree");
}

// ---- radii ----------------------------------------------------------------------------------------------

/// Where a branch leaves the lumen of its parent.
double leaves_parent_at_mm(const VesselTree& tree, const VesselBranch& branch) {
  if (branch.parent < 0) return 0;
  std::vector<bool> is_parent(tree.branches().size());
  is_parent[static_cast<std::size_t>(branch.parent)] = true;
  const TubePlaces parent(tree, is_parent);
  for (std::size_t k = 0; k < branch.points.size(); ++k)
    if (parent.deepest(branch.points[k].position_mm).out_mm > 0) return branch.arc_length_mm[k];
  return branch.arc_length_mm.back();
}

double smooth_step(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

/// How a branch's own factor comes in beside branches that have another: over two radii.
class Ramp {
 public:
  Ramp(const VesselTree& tree, std::size_t b, const std::vector<double>& radii)
      : factor_(radii[b]), length_mm_(tree.branches()[b].arc_length_mm.back()) {
    const VesselBranch& branch = tree.branches()[b];
    const auto differs = [&](int other) { return radii[static_cast<std::size_t>(other)] != factor_; };
    if (factor_ == 1) return;
    if (branch.parent >= 0 && differs(branch.parent)) {
      start_mm_ = leaves_parent_at_mm(tree, branch);
      rise_mm_ = 2 * point_at(branch, start_mm_).radius_mm;
    }
    if (std::ranges::any_of(branch.children, differs)) fall_mm_ = 2 * branch.points.back().radius_mm;
  }

  double at(double at_mm) const {
    double share = 1;
    if (rise_mm_ > 0) share *= smooth_step((at_mm - start_mm_) / rise_mm_);
    if (fall_mm_ > 0) share *= smooth_step((length_mm_ - at_mm) / fall_mm_);
    return std::lerp(1.0, factor_, share);
  }

 private:
  double factor_, length_mm_, start_mm_ = 0, rise_mm_ = 0, fall_mm_ = 0;
};

/// A point of the centreline with all that changes it.
VesselPoint changed_point(const VesselPoint& point, const glm::dvec3& along, double at_mm, double factor,
                          const std::vector<const PlacedStenosis*>& stenoses) {
  VesselPoint changed = point;
  if (factor != 1) changed.radius_mm *= factor;
  for (const PlacedStenosis* stenosis : stenoses) {
    const double lost = stenosis->lost * depth_at(*stenosis, at_mm);
    if (lost == 0) continue;
    const glm::dvec3 side = stenosis->towards - glm::dot(stenosis->towards, along) * along;
    if (glm::length(side) > 0) changed.position_mm += lost * changed.radius_mm * glm::normalize(side);
    changed.radius_mm *= 1 - lost;
  }
  return changed;
}

glm::dvec3 along_at(const VesselBranch& branch, std::size_t k) {
  const std::size_t before = k == 0 ? 0 : k - 1, after = std::min(k + 1, branch.points.size() - 1);
  return glm::normalize(branch.points[after].position_mm - branch.points[before].position_mm);
}

}  // namespace

WallChange wall_change(const VesselTree& tree, const PlacedEdits& edits) {
  VesselTree before = with_own_points(tree, edits.stenoses);
  std::vector<VesselBranch> branches = before.branches();
  for (std::size_t b = 0; b < branches.size(); ++b) {
    const VesselBranch& branch = before.branches()[b];
    const Ramp ramp(before, b, edits.scales.radii);
    std::vector<const PlacedStenosis*> here;
    for (const PlacedStenosis& stenosis : edits.stenoses)
      if (stenosis.branch == static_cast<int>(b)) here.push_back(&stenosis);
    for (std::size_t k = 0; k < branch.points.size(); ++k)
      branches[b].points[k] = changed_point(branch.points[k], along_at(branch, k), branch.arc_length_mm[k],
                                            ramp.at(branch.arc_length_mm[k]), here);
  }
  return {std::move(before), VesselTree(std::move(branches), "the edited tree")};
}

WallChange::WallChange(VesselTree before, VesselTree after)
    : before_(std::move(before)), after_(std::move(after)), lumens_before_(before_), lumens_after_(after_) {
  std::vector<SegmentIndex::Segment> pieces;
  for (std::size_t b = 0; b < before_.branches().size(); ++b) {
    const VesselBranch &was = before_.branches()[b], &is = after_.branches()[b];
    auto& changes = changes_.emplace_back(was.points.size() - 1);
    uneven_.push_back(uneven_pieces(was, is));
    for (std::size_t k = 0; k + 1 < was.points.size(); ++k) {
      changes[k] =
          !is_same_point(was.points[k], is.points[k]) || !is_same_point(was.points[k + 1], is.points[k + 1]);
      if (changes[k] == 0) continue;
      for (const VesselBranch* branch : {&was, &is})
        pieces.push_back(reach_of(*branch, static_cast<int>(b), k));
    }
  }
  if (!pieces.empty()) changed_ = std::make_unique<SegmentIndex>(std::move(pieces));
}

bool WallChange::changes(int branch, int point) const {
  return changes_[static_cast<std::size_t>(branch)][static_cast<std::size_t>(point)] != 0;
}

std::optional<WallChange::Both> WallChange::both_at(const TubePlace& place) const {
  if (!changes(place.branch, place.point)) return {};
  const auto b = static_cast<std::size_t>(place.branch), k = static_cast<std::size_t>(place.point);
  const auto at = [&](const VesselTree& tree) {
    const VesselPoint &p = tree.branches()[b].points[k], &q = tree.branches()[b].points[k + 1];
    return VesselPoint{glm::mix(p.position_mm, q.position_mm, place.fraction),
                       std::lerp(p.radius_mm, q.radius_mm, place.fraction)};
  };
  return Both{at(before_), at(after_)};
}

double WallChange::beyond_mm(const glm::dvec3& point_mm) const {
  if (!changed_) return std::numeric_limits<double>::infinity();
  return changed_->deepest(point_mm).out_mm();
}

glm::dvec3 WallChange::moved(const glm::dvec3& point_mm) const {
  if (beyond_mm(point_mm) > 0) return point_mm;
  const auto both = both_at(lumens_before_.deepest(point_mm));
  if (!both || is_beyond(point_mm, both->before)) return point_mm;
  return both->after.position_mm +
         both->after.radius_mm / both->before.radius_mm * (point_mm - both->before.position_mm);
}

LumenSource WallChange::source(const glm::dvec3& point_mm) const {
  using Kind = LumenSource::Kind;
  if (const double far_mm = beyond_mm(point_mm); far_mm > 0) return {.kind = Kind::same, .out_mm = far_mm};
  const TubePlace place = lumens_after_.deepest(point_mm);
  // A vessel's own cross-section, as moved() moves it: about a throat the nearest wall is that of its
  // shoulders. What only a wider vessel reaches belongs to that.
  const auto reaches = [&](const std::optional<Both>& both) {
    return both && !(is_beyond(point_mm, both->before) && is_beyond(point_mm, both->after));
  };
  auto both = both_at(lumens_before_.deepest(point_mm));
  if (!reaches(both)) both = both_at(place);
  if (!reaches(both)) return {};
  const glm::dvec3 from_mm = both->before.position_mm + both->before.radius_mm / both->after.radius_mm *
                                                            (point_mm - both->after.position_mm);
  if (is_beyond(from_mm, both->before)) return {.kind = Kind::empty, .out_mm = place.out_mm};
  if (from_mm == point_mm) return {};
  return {.kind = Kind::other, .from_mm = from_mm, .out_mm = place.out_mm};
}

double WallChange::edge_mm(const glm::dvec3& point_mm) const {
  constexpr double kAny = std::numeric_limits<double>::infinity();
  if (beyond_mm(point_mm) > 0) return kAny;
  const TubePlace place = lumens_before_.deepest(point_mm);
  if (!changes(place.branch, place.point)) return kAny;
  const auto k = static_cast<std::size_t>(place.point);
  const std::vector<char>& uneven = uneven_[static_cast<std::size_t>(place.branch)];
  const auto first = uneven.begin() + static_cast<std::ptrdiff_t>(k == 0 ? 0 : k - 1),
             last = uneven.begin() + static_cast<std::ptrdiff_t>(std::min(k + 2, uneven.size()));
  if (std::find(first, last, 1) == last) return kAny;
  return std::clamp(0.35 * place.radius_mm, 0.15, 0.8);
}

std::vector<glm::dvec3> WallChange::middles_mm() const {
  std::vector<glm::dvec3> middles;
  for (std::size_t b = 0; b < changes_.size(); ++b)
    for (std::size_t k = 0; k < changes_[b].size(); ++k)
      if (changes_[b][k] != 0) middles.push_back(before_.branches()[b].points[k].position_mm);
  return middles;
}

std::pair<glm::dvec3, glm::dvec3> WallChange::box_mm() const {
  glm::dvec3 lower(std::numeric_limits<double>::infinity()), upper = -lower;
  for (std::size_t b = 0; b < changes_.size(); ++b)
    for (std::size_t k = 0; k < changes_[b].size(); ++k)
      if (changes_[b][k] != 0)
        for (const VesselTree* tree : {&before_, &after_})
          for (const std::size_t i : {k, k + 1}) {
            const VesselPoint& point = tree->branches()[b].points[i];
            lower = glm::min(lower, point.position_mm - reach_mm(point.radius_mm));
            upper = glm::max(upper, point.position_mm + reach_mm(point.radius_mm));
          }
  return {lower, upper};
}

}  // namespace xraycast
