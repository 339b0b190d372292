#include "xraycast/given_vessels/wall_fit.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/evidence/place_in_tube.hpp"
#include "xraycast/geometry/segment_index.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

namespace xraycast {
namespace {

/// Where a wall's point is nearest to a tube.
struct Touch {
  int branch = -1;
  std::size_t segment = 0;  ///< of the branch
};

/// Normal equations for a place's step and the radius's: of residuals e with gradients (n, 1).
struct Equations {
  glm::dmat3 place{0};
  glm::dvec3 mixed{0}, place_rhs{0};
  double radius = 0, radius_rhs = 0;  ///< `radius` is the weight of all residuals too
  double squares_mm2 = 0;             ///< of the residuals

  void add(const Equations& other, double weight) {
    place += weight * other.place;
    mixed += weight * other.mixed;
    place_rhs += weight * other.place_rhs;
    radius += weight * other.radius;
    radius_rhs += weight * other.radius_rhs;
    squares_mm2 += weight * other.squares_mm2;
  }
  void add(const glm::dvec3& n, double residual_mm, double weight) {
    place += weight * glm::outerProduct(n, n);
    mixed += weight * n;
    place_rhs += weight * residual_mm * n;
    radius += weight;
    radius_rhs += weight * residual_mm;
    squares_mm2 += weight * residual_mm * residual_mm;
  }
  /// Held back where the wall tells little of a direction.
  void damp() {
    constexpr double kDamping = 0.02;
    place += kDamping * radius * glm::dmat3(1);
    radius *= 1 + kDamping;
  }
  /// What is left for the place once the radius follows it.
  glm::dmat3 reduced() const { return place - glm::outerProduct(mixed, mixed) / radius; }
  glm::dvec3 reduced_rhs() const { return place_rhs - mixed * (radius_rhs / radius); }
  double radius_step(const glm::dvec3& step) const { return (radius_rhs - glm::dot(mixed, step)) / radius; }
};

class WallFit {
 public:
  WallFit(std::vector<VesselBranch>& branches, const Mesh& wall) : branches_(branches), given_(branches) {
    constexpr std::size_t kMostPoints = 250'000;
    const std::size_t every = wall.points_mm.size() / kMostPoints + 1;
    for (std::size_t i = 0; i < wall.points_mm.size(); i += every) wall_mm_.emplace_back(wall.points_mm[i]);
    find_touches();
  }

  /// `width` in radii: of the stretch of a line, of which each point's step takes account.
  void step(double width) {
    gather();
    std::vector<std::vector<Equations>> around(branches_.size());
    parallel_for(std::ssize(branches_), [&](std::int64_t b) { around[index(b)] = windows(index(b), width); });
    for (std::size_t b = 0; b < branches_.size(); ++b) move_along(b, around[b]);
    for (std::size_t b = 0; b < branches_.size(); ++b)
      if (!branches_[b].children.empty()) move_junction(b, around);
  }

  /// Takes the lines back to where they were given, as far as the wall there is no round tube's, as in a
  /// dissected aorta: several tubes fit to it equally badly.
  void take_back() {
    constexpr double kWidth = 0.8;
    gather();
    std::vector<std::vector<double>> trusts;
    for (std::size_t b = 0; b < branches_.size(); ++b) trusts.push_back(trust_in(b, windows(b, kWidth)));
    // From junction to junction, each time one branch farther.
    for (bool has_changed = true; has_changed;) {
      has_changed = false;
      for (std::size_t b = 0; b < branches_.size(); ++b) let_change_slowly(points(b), trusts[b]);
      for (std::size_t b = 0; b < branches_.size(); ++b) has_changed |= share_least(b, trusts);
    }
    for (std::size_t b = 0; b < branches_.size(); ++b)
      for (std::size_t k = 0; k < points(b).size(); ++k) {
        const VesselPoint& given = given_[b].points[k];
        VesselPoint& fitted = points(b)[k];
        fitted = {glm::mix(given.position_mm, fitted.position_mm, trusts[b][k]),
                  std::lerp(given.radius_mm, fitted.radius_mm, trusts[b][k])};
      }
  }

  /// Lets free ends lie a radius from where the wall closes them.
  void fit_ends() {
    find_segments();
    std::vector<std::array<EndGap, 2>> gaps(branches_.size());
    for (std::size_t i = 0; i < wall_mm_.size(); ++i)
      if (touches_[i].branch >= 0) add_to_end(touches_[i], wall_mm_[i], gaps);
    for (std::size_t b = 0; b < branches_.size(); ++b) {
      shift_end(b, gaps[b][1].mean_mm());
      if (branches_[b].parent >= 0) continue;
      std::ranges::reverse(points(b));
      shift_end(b, gaps[b][0].mean_mm());
      std::ranges::reverse(points(b));
    }
    for (Touch& touch : touches_)
      if (touch.branch >= 0)
        touch.segment = std::min(touch.segment, points(static_cast<std::size_t>(touch.branch)).size() - 2);
  }

 private:
  static std::size_t index(std::int64_t i) { return static_cast<std::size_t>(i); }

  std::vector<VesselPoint>& points(std::size_t branch) { return branches_[branch].points; }
  const std::vector<VesselPoint>& points(std::size_t branch) const { return branches_[branch].points; }

  // ---- which tube a point of the wall belongs to --------------------------------------------------------

  PlaceInTube nearness(const glm::dvec3& point_mm, std::size_t branch, std::size_t segment) const {
    return place_in_tube(point_mm, points(branch)[segment], points(branch)[segment + 1]);
  }

  /// A branch's lines, and the box around its tube.
  struct Reach {
    SegmentIndex lines;
    glm::dvec3 low_mm, high_mm;
  };

  Reach reach_of(std::size_t branch) const {
    std::vector<SegmentIndex::Segment> segments;
    Reach reach{SegmentIndex({{glm::dvec3(0), glm::dvec3(1), 1, 1, 0, 0}}),
                glm::dvec3(std::numeric_limits<double>::infinity()),
                glm::dvec3(-std::numeric_limits<double>::infinity())};
    const auto& line = points(branch);
    for (std::size_t k = 0; k < line.size(); ++k) {
      reach.low_mm = glm::min(reach.low_mm, line[k].position_mm - 1.5 * line[k].radius_mm);
      reach.high_mm = glm::max(reach.high_mm, line[k].position_mm + 1.5 * line[k].radius_mm);
      if (k > 0)
        segments.push_back({line[k - 1].position_mm, line[k].position_mm, line[k - 1].radius_mm,
                            line[k].radius_mm, 0, static_cast<int>(k) - 1});
    }
    reach.lines = SegmentIndex(std::move(segments));
    return reach;
  }

  /// Points far from all tubes have none.
  void find_touches() {
    std::vector<Reach> reaches;
    for (std::size_t b = 0; b < branches_.size(); ++b) reaches.push_back(reach_of(b));
    touches_.resize(wall_mm_.size());
    parallel_for(std::ssize(wall_mm_), [&](std::int64_t i) {
      const glm::dvec3& point_mm = wall_mm_[index(i)];
      double least_mm = std::numeric_limits<double>::infinity();
      for (std::size_t b = 0; b < reaches.size(); ++b) {
        if (glm::any(glm::lessThan(point_mm, reaches[b].low_mm)) ||
            glm::any(glm::greaterThan(point_mm, reaches[b].high_mm)))
          continue;
        const auto found = reaches[b].lines.nearest(point_mm);
        if (found.out_mm() < least_mm) {
          least_mm = found.out_mm();
          touches_[index(i)] = {static_cast<int>(b), static_cast<std::size_t>(found.segment.point)};
        }
      }
    });
  }

  /// The segment of the same branch that is nearest now, from where it was.
  void follow(Touch& touch, const glm::dvec3& point_mm) const {
    const auto branch = static_cast<std::size_t>(touch.branch);
    const auto distance = [&](std::size_t segment) {
      return glm::length(nearness(point_mm, branch, segment).from_axis_mm);
    };
    const std::size_t last = points(branch).size() - 2;
    for (double here = distance(touch.segment);;) {
      const std::size_t before = touch.segment > 0 ? touch.segment - 1 : 0,
                        after = std::min(touch.segment + 1, last);
      const double to_before = distance(before), to_after = distance(after);
      if (std::min(to_before, to_after) >= here) return;
      touch.segment = to_before < to_after ? before : after;
      here = std::min(to_before, to_after);
    }
  }

  // ---- one step -----------------------------------------------------------------------------------------

  void find_segments() {
    parallel_for(std::ssize(wall_mm_), [&](std::int64_t i) {
      if (touches_[index(i)].branch >= 0) follow(touches_[index(i)], wall_mm_[index(i)]);
    });
  }

  /// The equations of each point of the lines.
  void gather() {
    equations_.assign(branches_.size(), {});
    for (std::size_t b = 0; b < branches_.size(); ++b) equations_[b].resize(points(b).size());
    find_segments();
    for (std::size_t i = 0; i < wall_mm_.size(); ++i) {
      const auto& [branch, segment] = touches_[i];
      if (branch < 0) continue;
      const auto b = static_cast<std::size_t>(branch);
      const PlaceInTube near = nearness(wall_mm_[i], b, segment);
      if (is_beyond_end(b, segment, near.fraction)) continue;
      const double away_mm = glm::length(near.from_axis_mm), gap_mm = away_mm - near.radius_mm;
      constexpr double kFarthest = 0.4;  // in radii: what lies farther away is no tube's wall
      if (!(away_mm > 0) || std::abs(gap_mm) > kFarthest * near.radius_mm) continue;
      const glm::dvec3 n = near.from_axis_mm / away_mm;
      equations_[b][segment].add(n, gap_mm, 1 - near.fraction);
      equations_[b][segment + 1].add(n, gap_mm, near.fraction);
    }
  }

  /// Of the cap of a free end, which its line may reach or not.
  bool is_beyond_end(std::size_t branch, std::size_t segment, double fraction) const {
    if (fraction <= 0 && segment == 0) return branches_[branch].parent < 0;
    return fraction >= 1 && segment + 2 == points(branch).size() && branches_[branch].children.empty();
  }

  /// For each point of a branch the equations of those about it: a Gaussian over their distances.
  std::vector<Equations> windows(std::size_t branch, double width) const {
    const auto& line = points(branch);
    std::vector<Equations> around(line.size());
    for (std::size_t k = 0; k < line.size(); ++k) {
      for_points_about(line, k, width,
                       [&](std::size_t j, double weight) { around[k].add(equations_[branch][j], weight); });
      around[k].damp();
    }
    return around;
  }

  /// Calls `visit` with the points about a line's point and their weights: a Gaussian over their distances,
  /// `width` in radii.
  template <typename Visit>
  static void for_points_about(const std::vector<VesselPoint>& line, std::size_t k, double width,
                               const Visit& visit) {
    constexpr double kReach = 2.5;  // in widths
    const double width_mm = width * line[k].radius_mm;
    const auto take = [&](std::size_t j) {
      const double widths = glm::distance(line[j].position_mm, line[k].position_mm) / width_mm;
      if (widths > kReach) return false;
      visit(j, std::exp(-0.5 * widths * widths));
      return true;
    };
    take(k);
    for (std::size_t j = k; j-- > 0 && take(j);) {
    }
    for (std::size_t j = k + 1; j < line.size() && take(j); ++j) {
    }
  }

  static bool tells(const Equations& equations) { return equations.radius > 6; }

  /// No step is longer than a part of the radius.
  static glm::dvec3 bounded(const glm::dvec3& step_mm, double radius_mm) {
    constexpr double kLongest = 0.1;
    const double length_mm = glm::length(step_mm);
    return length_mm > kLongest * radius_mm ? step_mm * (kLongest * radius_mm / length_mm) : step_mm;
  }

  static void change_radius(double step_mm, VesselPoint& point) {
    constexpr double kMost = 0.1;
    point.radius_mm *= 1 + std::clamp(step_mm / point.radius_mm, -kMost, kMost);
  }

  glm::dvec3 direction(std::size_t branch, std::size_t k) const {
    const auto& line = points(branch);
    const std::size_t before = k > 0 ? k - 1 : 0, after = std::min(k + 1, line.size() - 1);
    return glm::normalize(line[after].position_mm - line[before].position_mm);
  }

  bool is_junction(std::size_t branch, std::size_t k) const {
    return (k == 0 && branches_[branch].parent >= 0) ||
           (k + 1 == points(branch).size() && !branches_[branch].children.empty());
  }

  /// Moves all points of a branch but for its junctions.
  void move_along(std::size_t branch, const std::vector<Equations>& around) {
    auto& line = points(branch);
    std::vector<std::optional<glm::dvec3>> steps_mm(line.size());
    for (std::size_t k = 0; k < line.size(); ++k) {
      if (!tells(around[k]) || is_junction(branch, k)) continue;
      const glm::dvec3 step = glm::inverse(around[k].reduced()) * around[k].reduced_rhs(),
                       along = direction(branch, k);
      steps_mm[k] = bounded(step - glm::dot(step, along) * along, line[k].radius_mm);
    }
    const std::vector<glm::dvec3> even_mm = evened(line, steps_mm);
    for (std::size_t k = 0; k < line.size(); ++k) {
      if (!steps_mm[k]) continue;
      line[k].position_mm += even_mm[k];
      change_radius(around[k].radius_step(even_mm[k]), line[k]);
    }
  }

  /// Steps like those of the points about them: in a fork, where other vessels' walls are as near as a line's
  /// own, its points would part otherwise, each to another wall.
  static std::vector<glm::dvec3> evened(const std::vector<VesselPoint>& line,
                                        const std::vector<std::optional<glm::dvec3>>& steps_mm) {
    constexpr double kWidth = 0.3;  // in radii
    std::vector<glm::dvec3> even_mm(line.size(), glm::dvec3(0));
    for (std::size_t k = 0; k < line.size(); ++k) {
      double weights = 0;
      for_points_about(line, k, kWidth, [&](std::size_t j, double weight) {
        weights += weight;
        if (steps_mm[j]) even_mm[k] += weight * *steps_mm[j];
      });
      even_mm[k] /= weights;
    }
    return even_mm;
  }

  /// Moves the end of a branch with the starts of its children.
  void move_junction(std::size_t branch, const std::vector<std::vector<Equations>>& around) {
    glm::dmat3 place(0);
    glm::dvec3 rhs(0);
    const auto each = [&](const auto& visit) {
      visit(around[branch].back(), points(branch).back());
      for (const int child : branches_[branch].children)
        visit(around[static_cast<std::size_t>(child)].front(),
              points(static_cast<std::size_t>(child)).front());
    };
    bool is_told = false;
    each([&](const Equations& equations, const VesselPoint&) {
      if (!tells(equations)) return;
      is_told = true;
      place += equations.reduced();
      rhs += equations.reduced_rhs();
    });
    if (!is_told) return;
    const glm::dvec3 step = bounded(glm::inverse(place) * rhs, points(branch).back().radius_mm);
    each([&](const Equations& equations, VesselPoint& point) {
      point.position_mm += step;
      if (tells(equations)) change_radius(equations.radius_step(step), point);
    });
  }

  // ---- trust ----------------------------------------------------------------------------------------------

  /// 1 where the wall about a point is a round tube's, 0 where it is not.
  std::vector<double> trust_in(std::size_t branch, const std::vector<Equations>& around) const {
    constexpr double kRound = 0.02, kNotRound = 0.05;  // rms of the wall's distance from the tube, in radii
    std::vector<double> trust;
    for (std::size_t k = 0; k < around.size(); ++k) {
      const double rms_mm = std::sqrt(around[k].squares_mm2 / std::max(around[k].radius, 1e-9)),
                   relative = rms_mm / points(branch)[k].radius_mm;
      trust.push_back(std::clamp((kNotRound - relative) / (kNotRound - kRound), 0.0, 1.0));
    }
    return trust;
  }

  /// At a junction its vessels stay together. Whether something has changed.
  bool share_least(std::size_t parent, std::vector<std::vector<double>>& trusts) const {
    std::vector<double*> meeting{&trusts[parent].back()};
    for (const int child : branches_[parent].children)
      meeting.push_back(&trusts[static_cast<std::size_t>(child)].front());
    const double least = **std::ranges::min_element(meeting, {}, [](const double* trust) { return *trust; });
    bool has_changed = false;
    for (double* trust : meeting) has_changed |= std::exchange(*trust, least) != least;
    return has_changed;
  }

  /// By 1 along a radius at most, and towards less of it.
  static void let_change_slowly(const std::vector<VesselPoint>& line, std::vector<double>& trust) {
    const auto limit = [&](std::size_t k, std::size_t by) {
      const double change = glm::distance(line[k].position_mm, line[by].position_mm) / line[k].radius_mm;
      trust[k] = std::min(trust[k], trust[by] + change);
    };
    for (std::size_t k = 1; k < line.size(); ++k) limit(k, k - 1);
    for (std::size_t k = line.size() - 1; k-- > 0;) limit(k, k + 1);
  }

  // ---- ends ---------------------------------------------------------------------------------------------

  /// How far beyond an end its wall is too far, along the line.
  struct EndGap {
    double sum_mm = 0;
    int points = 0;
    double mean_mm() const { return points > 3 ? sum_mm / points : 0; }
  };

  /// The points within 37 degrees of the line's direction: a cap may be round or flat.
  void add_to_end(const Touch& touch, const glm::dvec3& point_mm,
                  std::vector<std::array<EndGap, 2>>& gaps) const {
    constexpr double kLeastCosine = 0.8;
    const auto b = static_cast<std::size_t>(touch.branch);
    const PlaceInTube near = nearness(point_mm, b, touch.segment);
    if (!is_beyond_end(b, touch.segment, near.fraction)) return;
    const bool is_last = near.fraction >= 1;
    const std::size_t end = is_last ? points(b).size() - 1 : 0;
    const double along_mm = glm::dot(near.from_axis_mm, (is_last ? 1.0 : -1.0) * direction(b, end)),
                 away_mm = glm::length(near.from_axis_mm);
    if (!(along_mm > kLeastCosine * away_mm)) return;
    EndGap& gap = gaps[b][is_last ? 1 : 0];
    gap.sum_mm += (away_mm - near.radius_mm) * away_mm / along_mm;
    ++gap.points;
  }

  /// Moves the last point along the line, and drops those that it passes.
  void shift_end(std::size_t branch, double step_mm) {
    auto& line = points(branch);
    const glm::dvec3 along = glm::normalize(line.back().position_mm - line[line.size() - 2].position_mm);
    const VesselPoint end{line.back().position_mm + step_mm * along, line.back().radius_mm};
    const double least_mm = 0.25 * glm::distance(line.back().position_mm, line[line.size() - 2].position_mm);
    while (line.size() > 2 && glm::dot(end.position_mm - line[line.size() - 2].position_mm, along) < least_mm)
      line.pop_back();
    if (glm::dot(end.position_mm - line[line.size() - 2].position_mm, along) >= least_mm) line.back() = end;
  }

  std::vector<VesselBranch>& branches_;
  const std::vector<VesselBranch> given_;
  std::vector<glm::dvec3> wall_mm_;
  std::vector<Touch> touches_;
  std::vector<std::vector<Equations>> equations_;
};

/// Leaves points out at which a line turns back, as where its end has been moved past them.
void remove_turns(std::vector<VesselPoint>& line) {
  for (std::size_t k = 1; k + 1 < line.size();) {
    const bool turns = glm::dot(line[k].position_mm - line[k - 1].position_mm,
                                line[k + 1].position_mm - line[k].position_mm) < 0;
    if (!turns) {
      ++k;
      continue;
    }
    line.erase(line.begin() + static_cast<std::ptrdiff_t>(k));
    k = std::max<std::size_t>(k - 1, 1);
  }
}

}  // namespace

void fit_to_wall(std::vector<VesselBranch>& branches, const Mesh& wall) {
  constexpr int kSteps = 12;
  WallFit fit(branches, wall);
  for (const double width : {0.4, 0.2})
    for (int i = 0; i < kSteps; ++i) fit.step(width);
  fit.take_back();
  for (int i = 0; i < 3; ++i) fit.fit_ends();
  for (VesselBranch& branch : branches) remove_turns(branch.points);
}

}  // namespace xraycast
