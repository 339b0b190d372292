#include "xraycast/radii/longer_ends.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/evidence/axes_across.hpp"
#include "xraycast/evidence/robust_statistics.hpp"
#include "xraycast/geometry/segment_index.hpp"
#include "xraycast/radii/tube_fit.hpp"
#include "xraycast/radii/tube_profile.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <iterator>
#include <limits>
#include <optional>
#include <span>
#include <utility>

namespace xraycast {
namespace {

/// The branches that end free.
std::vector<int> leaves_of(const VesselTree& tree) {
  std::vector<int> leaves;
  for (std::size_t b = 0; b < tree.branches().size(); ++b)
    if (tree.branches()[b].children.empty()) leaves.push_back(static_cast<int>(b));
  return leaves;
}

/// How far a tube may be from what is expected.
struct Freedom {
  double off_vox, most_off_vox;  ///< in one direction, as known before; in all
  double radius;                 ///< times that of a step
};
constexpr Freedom kAtStart{1, 2, 2}, kOnTheWay{0.5, 0.7, 1};

constexpr double kNewRadius = 0.3;  // of that of a step: a vessel's radius changes slowly

/// A place on the way.
struct Front {
  VesselPoint point;
  glm::dvec3 tangent;
};

/// A vessel followed from a place before its end.
struct Followed {
  double back_mm;    ///< from that place to the end
  double beyond_mm;  ///< how far it goes on; negative where the end was not reached
  std::vector<VesselPoint> points;
  std::size_t old = 1;  ///< those of them that are not beyond the end
};

class EndFollower {
 public:
  EndFollower(const VesselTree& tree, const TubeQuestions& tubes, const LumenBrightness& brightness)
      : tree_(tree), tubes_(tubes), brightness_(brightness) {
    for (const VesselBranch& branch : tree.branches())
      for (const VesselPoint& p : branch.points) widest_mm_ = std::max(widest_mm_, p.radius_mm);
  }

  /// Nothing where the vessel ends with its branch: within 4 voxels, of which half a window cannot tell.
  std::optional<Followed> follow(int leaf) const {
    // The lines of ends turn aside where a mask has swollen; the farther back, the surer is the start.
    constexpr std::array<double, 4> kBack_vox{6, 12, 20, 30};
    constexpr double kReached_vox = 1.5, kLeast_vox = 4;
    const double voxel_mm = tubes_.voxel_mm(), half_mm = 0.5 * branch_of(leaf).arc_length_mm.back();
    for (const double back_vox : kBack_vox) {
      const double back_mm = back_vox * voxel_mm;
      if (back_mm > half_mm) break;
      std::optional<Followed> found = follow_from(leaf, back_mm);
      if (!found || found->beyond_mm < -kReached_vox * voxel_mm) continue;
      if (found->beyond_mm < kLeast_vox * voxel_mm) return std::nullopt;
      smooth(found->points);
      set_radii(leaf, *found);
      return found;
    }
    return std::nullopt;
  }

 private:
  const VesselBranch& branch_of(int leaf) const { return tree_.branches()[static_cast<std::size_t>(leaf)]; }

  std::optional<Followed> follow_from(int leaf, double back_mm) const {
    constexpr double kMost_mm = 60, kNewDirection = 0.5;  // of a step's
    constexpr int kMisses = 3;
    const double voxel_mm = tubes_.voxel_mm();
    std::optional<Front> front = start(leaf, back_mm);
    if (!front) return std::nullopt;
    Followed followed{back_mm, -back_mm, {front->point}};
    std::vector<VesselPoint> missed;
    for (double beyond_mm = -back_mm; beyond_mm < kMost_mm && std::ssize(missed) < kMisses;) {
      Front next = *front;
      next.point.position_mm += static_cast<double>(missed.size() + 1) * voxel_mm * front->tangent;
      beyond_mm += voxel_mm;
      const std::optional<VesselPoint> seen = look(leaf, next, kOnTheWay);
      if (!seen) {
        missed.push_back(next.point);
        continue;
      }
      if (is_in_tree(leaf, seen->position_mm, back_mm) || is_astray(leaf, *seen, beyond_mm)) break;
      const glm::dvec3 step = seen->position_mm - front->point.position_mm;
      front->tangent = glm::normalize(glm::mix(front->tangent, glm::normalize(step), kNewDirection));
      front->point = {seen->position_mm, std::lerp(front->point.radius_mm, seen->radius_mm, kNewRadius)};
      std::ranges::copy(missed, std::back_inserter(followed.points));
      followed.points.push_back(front->point);
      followed.beyond_mm = beyond_mm;
      if (beyond_mm <= 0) followed.old = followed.points.size();
      missed.clear();
    }
    return followed;
  }

  /// Whether a place lies in another branch, or in its own one well before the start.
  bool is_in_tree(int leaf, const glm::dvec3& at_mm, double back_mm) const {
    constexpr double kRadii = 6;
    const VesselBranch& branch = branch_of(leaf);
    const auto is_within = [&](const SegmentIndex::Nearest& place) {
      if (place.out_mm() >= 0) return false;
      if (place.segment.branch != leaf) return true;
      const double mm = branch.arc_length_mm[static_cast<std::size_t>(place.segment.point)];
      return mm < branch.arc_length_mm.back() - back_mm - kRadii * place.radius_mm();
    };
    return tree_.segments().nearest(at_mm, widest_mm_, is_within).has_value();
  }

  /// Whether a place on the way to the end lies out of the branch: that is another vessel.
  bool is_astray(int leaf, const VesselPoint& seen, double beyond_mm) const {
    constexpr double kOut_vox = 2;
    if (beyond_mm > 0) return false;
    const VesselPoint line = point_before(leaf, -beyond_mm);
    return glm::distance(seen.position_mm, line.position_mm) > line.radius_mm + kOut_vox * tubes_.voxel_mm();
  }

  /// Means of three points, twice, but for both ends.
  static void smooth(std::vector<VesselPoint>& points) {
    for (int pass = 0; pass < 2; ++pass) {
      const std::vector<VesselPoint> before = points;
      for (std::size_t i = 1; i + 1 < points.size(); ++i)
        points[i].position_mm =
            0.25 * before[i - 1].position_mm + 0.5 * before[i].position_mm + 0.25 * before[i + 1].position_mm;
    }
  }

  /// Radii once the way is known. Beside an organ that is nearly as bright a vessel seems wider and darker
  /// than it is: so its lumen is as bright as usual here, and it gets no wider than it was before its end.
  void set_radii(int leaf, Followed& followed) const {
    constexpr double kLumen = 0.1, kRadius = 0.3;
    std::vector<VesselPoint>& points = followed.points;
    const double first_mm = radius_before_mm(leaf, followed.back_mm);
    double now_mm = first_mm;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const glm::dvec3 along =
          points[std::min(i + 1, points.size() - 1)].position_mm - points[i > 0 ? i - 1 : 0].position_mm;
      auto [samples, question] =
          asked(leaf, {{points[i].position_mm, now_mm}, glm::normalize(along)}, kLumen);
      if (question) {
        question->radius = {first_mm, kRadius * first_mm};
        if (const auto found = fit(samples, *question))
          now_mm = std::min(std::lerp(now_mm, found->tube.radius_mm, kNewRadius), first_mm);
      }
      points[i].radius_mm = now_mm;
    }
  }

  VesselPoint point_before(int leaf, double mm) const {
    const VesselBranch& branch = branch_of(leaf);
    return point_at(branch, branch.arc_length_mm.back() - mm);
  }

  /// The radius at a distance before an end, or farther back where it is less there.
  double radius_before_mm(int leaf, double back_mm) const {
    constexpr int kBefore_vox = 30;
    std::vector<double> radii_mm{point_before(leaf, back_mm).radius_mm};
    for (int i = 1; i < kBefore_vox; ++i) {
      const double mm = back_mm + i * tubes_.voxel_mm();
      if (mm < branch_of(leaf).arc_length_mm.back()) radii_mm.push_back(point_before(leaf, mm).radius_mm);
    }
    return std::min(radii_mm.front(), quantile(radii_mm, 0.5));
  }

  /// What the vessel is before its end: where a mask has swollen, no wider than it was farther back.
  std::optional<Front> start(int leaf, double back_mm) const {
    constexpr double kWidest_vox = 6, kDirection_vox = 4;
    const double voxel_mm = tubes_.voxel_mm();
    const VesselPoint here{point_before(leaf, back_mm).position_mm, radius_before_mm(leaf, back_mm)};
    const glm::dvec3 along =
        here.position_mm - point_before(leaf, back_mm + kDirection_vox * voxel_mm).position_mm;
    if (here.radius_mm > kWidest_vox * voxel_mm || !(glm::length(along) > 0)) return std::nullopt;
    const Front front{here, glm::normalize(along)};
    const std::optional<VesselPoint> seen = look(leaf, front, kAtStart);
    if (!seen) return std::nullopt;
    return Front{*seen, front.tangent};
  }

  /// The vessel about a place where it is expected; nothing where it is not seen.
  std::optional<VesselPoint> look(int leaf, const Front& expected, const Freedom& freedom) const {
    constexpr double kRadius_vox = 0.1, kRadius = 0.1, kLumen = 0.3;
    check_cancelled();
    const double voxel_mm = tubes_.voxel_mm(), radius_mm = expected.point.radius_mm;
    const auto [u, v] = axes_across(expected.tangent);
    if (!is_in_scan(expected.point.position_mm) || !tubes_.is_round(brightness_.blur_mm, u, v))
      return std::nullopt;
    auto [samples, question] = asked(leaf, expected, kLumen);
    if (!question) return std::nullopt;
    question->radius = {radius_mm, freedom.radius * (kRadius_vox * voxel_mm + kRadius * radius_mm)};
    question->off_x = question->off_y = {0, freedom.off_vox * voxel_mm};
    const auto found = fit(samples, *question);
    if (!found || glm::length(found->tube.off_mm) > freedom.most_off_vox * voxel_mm ||
        !is_vessel(*found, radius_mm) || !goes_on(samples, found->tube, question->blur_mm))
      return std::nullopt;
    const glm::dvec2 off_mm = found->tube.off_mm;
    return VesselPoint{expected.point.position_mm + off_mm.x * u + off_mm.y * v, found->tube.radius_mm};
  }

  /// A tube in one tissue, or else in another one in each direction. Fat or an organ behind a thin layer of
  /// tissue is left out of the former; the latter takes the layer for vessel.
  std::optional<TubeAnswer> fit(const std::vector<SampleAcross>& samples,
                                const TubeQuestion& question) const {
    if (!question.is_even) {
      constexpr double kBrighter = 0.6;
      TubeQuestion in_one = question;
      auto& around_hu = in_one.start.around_hu;
      in_one.is_even = true;
      around_hu.fill(quantile({around_hu.begin(), around_hu.end()}, kBrighter));
      const auto found = fit_tube(samples, in_one);
      if (found && tubes_.is_explained(*found) && has_clear_wall(samples, found->tube, in_one)) return found;
    }
    return fit_tube(samples, question);
  }

  /// Whether most of what is about the wall of a tube in one tissue is of these two, and nothing beside it is
  /// nearly as bright as its lumen.
  bool has_clear_wall(const std::vector<SampleAcross>& samples, const Tube& tube,
                      const TubeQuestion& question) const {
    constexpr double kAbout_vox = 0.8, kBeside_vox = 2, kDeviations = 2.5, kLeast = 0.85;
    const TubeProfile profile(tube.radius_mm, question.blur_mm);
    double about = 0, own = 0;
    std::array<double, Tube::kDirections> off_hu{}, beside{};
    for (const SampleAcross& s : samples) {
      const glm::dvec2 from_mm = s.at_mm - tube.off_mm;
      const double mm = glm::length(from_mm), out_vox = (mm - tube.radius_mm) / tubes_.voxel_mm(),
                   residual_hu =
                       s.hu - std::lerp(tube.around_hu.front(), tube.lumen_hu, profile.at(mm).share);
      if (std::abs(out_vox) < kAbout_vox) {
        about += s.weight;
        if (std::abs(residual_hu) < kDeviations * question.noise_hu) own += s.weight;
      }
      if (out_vox > 0 && out_vox < kBeside_vox) {
        const std::size_t side = nearest_direction(from_mm);
        off_hu[side] += s.weight * residual_hu;
        beside[side] += s.weight;
      }
    }
    Tube sides = tube;
    for (std::size_t k = 0; k < Tube::kDirections; ++k)
      if (beside[k] > 0) sides.around_hu[k] += off_hu[k] / beside[k];
    return own > kLeast * about && is_apart(sides, tube.contrast_hu());
  }

  struct Asked {
    std::vector<SampleAcross> samples;
    std::optional<TubeQuestion> question;  ///< nothing without contrast
  };

  /// The question about a tube at a place, on the way; `lumen` is how far its brightness may be from that of
  /// most vessels, of the spread of that.
  Asked asked(int leaf, const Front& place, double lumen) const {
    const double radius_mm = place.point.radius_mm;
    std::vector<SampleAcross> samples = samples_about(leaf, place, tubes_.window_mm(radius_mm));
    const auto guessed = tubes_.guess(close_to(samples, radius_mm), radius_mm);
    if (!guessed) return {};
    TubeQuestion q =
        tubes_.question(*guessed, tubes_.across_mm(brightness_.blur_mm, place.tangent), radius_mm);
    q.lumen = {brightness_.usual.hu, lumen * brightness_.usual.spread_hu};
    q.start.lumen_hu = q.lumen.mean;
    return {std::move(samples), q};
  }

  /// Samples that tell what is around a vessel: a thin layer may lie between it and something else.
  std::vector<SampleAcross> close_to(const std::vector<SampleAcross>& samples, double radius_mm) const {
    constexpr double kClose_vox = 2.5;
    std::vector<SampleAcross> close;
    std::ranges::copy_if(samples, std::back_inserter(close), [&](const SampleAcross& s) {
      return glm::length(s.at_mm) < radius_mm + kClose_vox * tubes_.voxel_mm();
    });
    return close;
  }

  bool is_in_scan(const glm::dvec3& p) const {
    const VolumeGeometry& grid = tubes_.scan().volume.geometry();
    const glm::dvec3 lower = grid.lower_mm(), upper = grid.upper_mm();
    return glm::all(glm::greaterThanEqual(p, lower)) && glm::all(glm::lessThanEqual(p, upper));
  }

  bool is_vessel(const TubeAnswer& found, double before_mm) const {
    constexpr double kThinner = 0.7, kWider = 1.3;
    const double radius_mm = found.tube.radius_mm;
    return tubes_.is_explained(found) && radius_mm > kThinner * before_mm && radius_mm < kWider * before_mm &&
           is_apart(found.tube, found.tube.contrast_hu());
  }

  /// Whether a lumen is brighter than the quarter of its surroundings that is brightest.
  static bool is_apart(const Tube& tube, double contrast_hu) {
    constexpr double kLeast = 0.15;
    constexpr std::size_t kQuarter = Tube::kDirections / 4;
    double brightest_hu = -std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < Tube::kDirections; ++k) {
      double sum_hu = 0;
      for (std::size_t i = 0; i < kQuarter; ++i) sum_hu += tube.around_hu[(k + i) % Tube::kDirections];
      brightest_hu = std::max(brightest_hu, sum_hu / kQuarter);
    }
    return tube.lumen_hu - brightest_hu > kLeast * contrast_hu;
  }

  /// Whether the tube is there in what lies ahead too: half of its window is in the vessel before.
  bool goes_on(const std::vector<SampleAcross>& samples, const Tube& tube, double blur_mm) const {
    constexpr double kAhead = 0.75, kLeast = 0.5, kDeviations = 5;
    const double ahead_mm = kAhead * tubes_.window_mm(tube.radius_mm);
    const TubeProfile profile(tube.radius_mm, blur_mm);
    double sum = 0, squares = 0;
    for (const SampleAcross& s : samples) {
      if (s.along_mm < 0 || s.along_mm > ahead_mm) continue;
      const double around_hu = tube.around_hu[nearest_direction(s.at_mm)],
                   share = profile.at(glm::distance(s.at_mm, tube.off_mm)).share,
                   shown_hu = tubes_.shown_hu(around_hu),
                   expected_hu = tubes_.shown_hu(std::lerp(around_hu, tube.lumen_hu, share)) - shown_hu;
      sum += expected_hu * (s.hu - shown_hu);
      squares += expected_hu * expected_hu;
    }
    return sum > kLeast * squares && sum > kDeviations * tubes_.scan().noise_hu * std::sqrt(squares);
  }

  /// Those about a place that are not in or beside another branch.
  std::vector<SampleAcross> samples_about(int leaf, const Front& front, double half_mm) const {
    constexpr double kBeyond_vox = 3.5, kApart_vox = 1.5;
    const Volume& volume = tubes_.scan().volume;
    const VolumeGeometry& grid = volume.geometry();
    const double apart_mm = kApart_vox * tubes_.voxel_mm(),
                 across_mm = front.point.radius_mm + kBeyond_vox * tubes_.voxel_mm(),
                 all_mm = std::hypot(across_mm, half_mm);
    const glm::dvec3 middle_mm = front.point.position_mm, middle = grid.to_index(middle_mm),
                     reach = all_mm / grid.spacing_mm;
    const auto is_beside = [&](const SegmentIndex::Nearest& place) {
      return place.segment.branch != leaf && place.out_mm() < apart_mm;
    };
    const auto is_near = [&](const SegmentIndex::Nearest& place) {
      return place.segment.branch != leaf && place.out_mm() < apart_mm + all_mm;
    };
    const bool has_others =
        tree_.segments().nearest(middle_mm, widest_mm_ + apart_mm + all_mm, is_near).has_value();
    const auto [u, v] = axes_across(front.tangent);
    std::vector<SampleAcross> samples;
    const Index3 lower = glm::max(Index3(glm::ceil(middle - reach)), Index3(0)),
                 upper = glm::min(Index3(glm::floor(middle + reach)), grid.size - Index3(1));
    for (std::int64_t z = lower.z; z <= upper.z; ++z)
      for (std::int64_t y = lower.y; y <= upper.y; ++y)
        for (std::int64_t x = lower.x; x <= upper.x; ++x) {
          const glm::dvec3 p = grid.to_world_mm(glm::dvec3(x, y, z)), from = p - middle_mm;
          const double along_mm = glm::dot(from, front.tangent);
          const glm::dvec2 at(glm::dot(from, u), glm::dot(from, v));
          if (std::abs(along_mm) >= half_mm || glm::length(at) > across_mm) continue;
          if (has_others && tree_.segments().nearest(p, widest_mm_ + apart_mm, is_beside)) continue;
          samples.push_back(
              {at, along_mm, 1 - std::abs(along_mm) / half_mm, static_cast<double>(volume.at(x, y, z))});
        }
    return samples;
  }

  const VesselTree& tree_;
  const TubeQuestions& tubes_;
  const LumenBrightness& brightness_;
  double widest_mm_ = 0;
};

bool touch(const VesselPoint& a, const VesselPoint& b) {
  return glm::distance(a.position_mm, b.position_mm) < a.radius_mm + b.radius_mm;
}

/// Whether two ends were followed into one vessel, or across it.
bool meet(const Followed& a, const Followed& b) {
  const auto beyond = [](const Followed& f) { return std::span(f.points).subspan(f.old); };
  return std::ranges::any_of(beyond(a), [&](const VesselPoint& p) {
    return std::ranges::any_of(beyond(b), [&](const VesselPoint& q) { return touch(p, q); });
  });
}

/// A branch's points with those that were followed in the place of its end, a few voxels between them: what
/// was followed may begin beside the line.
std::vector<VesselPoint> continued(std::vector<VesselPoint> points, const Followed& followed,
                                   double voxel_mm) {
  constexpr double kBetween_vox = 2.5;
  const double least_mm = followed.back_mm + kBetween_vox * voxel_mm;
  for (double left_out_mm = 0; points.size() > 1 && left_out_mm < least_mm; points.pop_back())
    left_out_mm += glm::distance(points.back().position_mm, points[points.size() - 2].position_mm);
  std::ranges::copy(followed.points, std::back_inserter(points));
  return points;
}

}  // namespace

LongerEnds with_longer_ends(const VesselTree& tree, const ScanOfVessels& scan,
                            const LumenBrightness& brightness, const std::string& name, Progress& progress) {
  progress.begin("following vessels beyond their ends", 1, "passes");
  const TubeQuestions tubes(scan);
  const EndFollower follower(tree, tubes, brightness);
  const std::vector<int> leaves = leaves_of(tree);
  std::vector<std::optional<Followed>> found(leaves.size());
  parallel_for(std::ssize(leaves), [&](std::int64_t i) {
    const auto at = static_cast<std::size_t>(i);
    found[at] = follower.follow(leaves[at]);
  });
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < found.size(); ++i)
    if (found[i]) order.push_back(i);
  std::ranges::stable_sort(order, std::greater(), [&](std::size_t i) { return found[i]->beyond_mm; });

  std::vector<VesselBranch> branches = tree.branches();
  std::vector<const Followed*> taken;
  std::vector<std::vector<VesselPoint>> lines;
  for (const std::size_t i : order) {
    if (std::ranges::any_of(taken, [&](const Followed* other) { return meet(*other, *found[i]); })) continue;
    std::vector<VesselPoint>& points = branches[static_cast<std::size_t>(leaves[i])].points;
    points = continued(std::move(points), *found[i], tubes.voxel_mm());
    taken.push_back(&*found[i]);
    lines.push_back(found[i]->points);
  }
  progress.advance();
  return {VesselTree(std::move(branches), name), std::move(lines)};
}

}  // namespace xraycast
