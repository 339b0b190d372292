#include "xraycast/radii/longer_ends.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/evidence/axes_across.hpp"
#include "xraycast/evidence/robust_statistics.hpp"
#include "xraycast/geometry/segment_index.hpp"
#include "xraycast/radii/tube_fit.hpp"
#include "xraycast/radii/tube_profile.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

namespace xraycast {
namespace {

/// A branch's end where no other one begins.
struct FreeEnd {
  int branch;
  bool is_first;  ///< its first point: the root
};

std::vector<FreeEnd> free_ends(const VesselTree& tree) {
  std::vector<FreeEnd> ends;
  for (std::size_t b = 0; b < tree.branches().size(); ++b) {
    const VesselBranch& branch = tree.branches()[b];
    if (branch.children.empty()) ends.push_back({static_cast<int>(b), false});
    if (branch.parent < 0) ends.push_back({static_cast<int>(b), true});
  }
  return ends;
}

/// How far a tube may be from what is expected.
struct Freedom {
  double off_vox, most_off_vox;  ///< in one direction, as known before; in all
  double radius;                 ///< times that of a step
};
constexpr Freedom kAtStart{1, 2, 2}, kOnTheWay{0.5, 0.7, 1};

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
};

class EndFollower {
 public:
  EndFollower(const VesselTree& tree, const TubeQuestions& tubes, const LumenBrightness& brightness)
      : tree_(tree), tubes_(tubes), brightness_(brightness) {
    for (const VesselBranch& branch : tree.branches())
      for (const VesselPoint& p : branch.points) widest_mm_ = std::max(widest_mm_, p.radius_mm);
  }

  /// Nothing where the vessel ends with its branch.
  std::optional<Followed> follow(const FreeEnd& end) const {
    // The lines of ends turn aside where a mask has swollen; the farther back, the surer is the start.
    constexpr std::array<double, 4> kBack_vox{6, 12, 20, 30};
    const double voxel_mm = tubes_.voxel_mm(), least_mm = 1.5 * voxel_mm,
                 half_mm = 0.5 * branch_of(end).arc_length_mm.back();
    for (const double back_vox : kBack_vox) {
      const double back_mm = std::min(back_vox * voxel_mm, half_mm);
      if (std::optional<Followed> found = follow_from(end, back_mm)) {
        if (found->beyond_mm >= least_mm) return found;
        if (found->beyond_mm > -least_mm) return std::nullopt;
      }
      if (back_mm == half_mm) break;
    }
    return std::nullopt;
  }

 private:
  const VesselBranch& branch_of(const FreeEnd& end) const {
    return tree_.branches()[static_cast<std::size_t>(end.branch)];
  }

  std::optional<Followed> follow_from(const FreeEnd& end, double back_mm) const {
    constexpr double kMost_mm = 60, kNewDirection = 0.5, kNewRadius = 0.3;  // of a step's
    constexpr int kMisses = 3;
    const double voxel_mm = tubes_.voxel_mm();
    std::optional<Front> front = start(end, back_mm);
    if (!front) return std::nullopt;
    Followed followed{back_mm, -back_mm, {front->point}};
    std::vector<VesselPoint> missed;
    for (double beyond_mm = -back_mm; beyond_mm < kMost_mm && std::ssize(missed) < kMisses;) {
      Front next = *front;
      next.point.position_mm += static_cast<double>(missed.size() + 1) * voxel_mm * front->tangent;
      beyond_mm += voxel_mm;
      const std::optional<VesselPoint> seen = look(end, next, kOnTheWay);
      if (!seen) {
        missed.push_back(next.point);
        continue;
      }
      const glm::dvec3 step = seen->position_mm - front->point.position_mm;
      front->tangent = glm::normalize(glm::mix(front->tangent, glm::normalize(step), kNewDirection));
      front->point = {seen->position_mm, std::lerp(front->point.radius_mm, seen->radius_mm, kNewRadius)};
      std::ranges::copy(missed, std::back_inserter(followed.points));
      followed.points.push_back(front->point);
      followed.beyond_mm = beyond_mm;
      missed.clear();
    }
    return followed;
  }

  /// What the vessel is before its end: where a mask has swollen, no wider than it was farther back.
  std::optional<Front> start(const FreeEnd& end, double back_mm) const {
    constexpr double kWidest_vox = 6, kDirection_vox = 4;
    constexpr int kBefore_vox = 30;
    const VesselBranch& branch = branch_of(end);
    const double all_mm = branch.arc_length_mm.back(), voxel_mm = tubes_.voxel_mm();
    const auto before_end = [&](double mm) {
      return point_at(branch, end.is_first ? std::min(mm, all_mm) : std::max(all_mm - mm, 0.0));
    };
    VesselPoint here = before_end(back_mm);
    const glm::dvec3 along = here.position_mm - before_end(back_mm + kDirection_vox * voxel_mm).position_mm;
    std::vector<double> radii_mm;
    for (int i = 0; i < kBefore_vox && back_mm + i * voxel_mm < all_mm; ++i)
      radii_mm.push_back(before_end(back_mm + i * voxel_mm).radius_mm);
    here.radius_mm = std::min(here.radius_mm, quantile(radii_mm, 0.5));
    if (here.radius_mm > kWidest_vox * voxel_mm || !(glm::length(along) > 0)) return std::nullopt;
    const Front front{here, glm::normalize(along)};
    const std::optional<VesselPoint> seen = look(end, front, kAtStart);
    if (!seen) return std::nullopt;
    return Front{*seen, front.tangent};
  }

  /// The vessel about a place where it is expected; nothing where it is not seen.
  std::optional<VesselPoint> look(const FreeEnd& end, const Front& expected, const Freedom& freedom) const {
    constexpr double kRadius_vox = 0.1, kRadius = 0.1, kLumen = 0.6;  // of the usual lumen's spread
    check_cancelled();
    const double voxel_mm = tubes_.voxel_mm(), radius_mm = expected.point.radius_mm,
                 half_mm = tubes_.window_mm(radius_mm);
    if (!is_in_scan(expected.point.position_mm)) return std::nullopt;
    const std::vector<SampleAcross> samples = samples_about(end, expected, half_mm);
    const auto guessed = tubes_.guess(close_to(samples, radius_mm), radius_mm);
    if (!guessed) return std::nullopt;
    TubeQuestion q =
        tubes_.question(*guessed, tubes_.across_mm(brightness_.blur_mm, expected.tangent), radius_mm);
    q.lumen = {brightness_.usual.hu, kLumen * brightness_.usual.spread_hu};
    q.start.lumen_hu = q.lumen.mean;
    q.radius = {radius_mm, freedom.radius * (kRadius_vox * voxel_mm + kRadius * radius_mm)};
    q.off_x = q.off_y = {0, freedom.off_vox * voxel_mm};
    const auto found = fit_tube(samples, q);
    if (!found || glm::length(found->tube.off_mm) > freedom.most_off_vox * voxel_mm ||
        !is_vessel(*found, radius_mm) || !goes_on(samples, found->tube, q.blur_mm, half_mm))
      return std::nullopt;
    const Tube& tube = found->tube;
    const auto [u, v] = axes_across(expected.tangent);
    return VesselPoint{expected.point.position_mm + tube.off_mm.x * u + tube.off_mm.y * v, tube.radius_mm};
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
    constexpr double kThinner = 0.7, kWider = 1.3, kShareIn = 0.7, kUneven = 0.12, kTimesNoise = 1.5,
                     kOnEachSide = 0.15;
    const double contrast_hu = found.tube.contrast_hu(), radius_mm = found.tube.radius_mm;
    return contrast_hu > 0 && radius_mm > kThinner * before_mm && radius_mm < kWider * before_mm &&
           found.share_in > kShareIn &&
           found.rms_hu < kTimesNoise * std::hypot(tubes_.scan().noise_hu, kUneven * contrast_hu) &&
           least_contrast_hu(found.tube) > kOnEachSide * contrast_hu;
  }

  /// To the quarter of the surroundings that is brightest.
  static double least_contrast_hu(const Tube& tube) {
    constexpr std::size_t kQuarter = Tube::kDirections / 4;
    double brightest_hu = -std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < Tube::kDirections; ++k) {
      double sum_hu = 0;
      for (std::size_t i = 0; i < kQuarter; ++i) sum_hu += tube.around_hu[(k + i) % Tube::kDirections];
      brightest_hu = std::max(brightest_hu, sum_hu / kQuarter);
    }
    return tube.lumen_hu - brightest_hu;
  }

  /// Whether the tube is there in what lies ahead too: half of its window is in the vessel before.
  bool goes_on(const std::vector<SampleAcross>& samples, const Tube& tube, double blur_mm,
               double half_mm) const {
    constexpr double kAhead = 0.75, kLeast = 0.5, kDeviations = 5;
    const TubeProfile profile(tube.radius_mm, blur_mm);
    double sum = 0, squares = 0;
    for (const SampleAcross& s : samples) {
      if (s.along_mm < 0 || s.along_mm > kAhead * half_mm) continue;
      const double around_hu = tube.around_hu[nearest_direction(s.at_mm)],
                   expected_hu =
                       profile.at(glm::distance(s.at_mm, tube.off_mm)).share * (tube.lumen_hu - around_hu);
      sum += expected_hu * (s.hu - around_hu);
      squares += expected_hu * expected_hu;
    }
    return sum > kLeast * squares && sum > kDeviations * tubes_.scan().noise_hu * std::sqrt(squares);
  }

  /// Those about a place that are not in or beside another branch.
  std::vector<SampleAcross> samples_about(const FreeEnd& end, const Front& front, double half_mm) const {
    constexpr double kBeyond_vox = 3.5, kApart_vox = 1.5;
    const Volume& volume = tubes_.scan().volume;
    const VolumeGeometry& grid = volume.geometry();
    const double apart_mm = kApart_vox * tubes_.voxel_mm(),
                 across_mm = front.point.radius_mm + kBeyond_vox * tubes_.voxel_mm(),
                 all_mm = std::hypot(across_mm, half_mm);
    const glm::dvec3 middle_mm = front.point.position_mm, middle = grid.to_index(middle_mm),
                     reach = all_mm / grid.spacing_mm;
    const auto is_beside = [&](const SegmentIndex::Nearest& place) {
      return place.segment.branch != end.branch && place.out_mm() < apart_mm;
    };
    const auto is_near = [&](const SegmentIndex::Nearest& place) {
      return place.segment.branch != end.branch && place.out_mm() < apart_mm + all_mm;
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
bool meet(const std::vector<VesselPoint>& a, const std::vector<VesselPoint>& b) {
  return std::ranges::any_of(a, [&](const VesselPoint& p) {
    return std::ranges::any_of(b, [&](const VesselPoint& q) { return touch(p, q); });
  });
}

/// A vessel that is followed does not widen: beside an organ that is nearly as bright it only seems to.
void narrow(std::vector<VesselPoint>& points) {
  for (std::size_t i = 1; i < points.size(); ++i)
    points[i].radius_mm = std::min(points[i].radius_mm, points[i - 1].radius_mm);
}

/// A branch's points with those that were followed in the place of its end.
std::vector<VesselPoint> continued(const VesselBranch& branch, bool is_first, const Followed& followed,
                                   double voxel_mm) {
  std::vector<VesselPoint> points = branch.points;
  if (is_first) std::ranges::reverse(points);
  const double all_mm = branch.arc_length_mm.back(), kept_mm = all_mm - followed.back_mm - 0.5 * voxel_mm;
  std::size_t kept = 1;
  while (kept < points.size()) {
    const std::size_t at = is_first ? points.size() - 1 - kept : kept;
    const double mm = is_first ? all_mm - branch.arc_length_mm[at] : branch.arc_length_mm[at];
    if (mm >= kept_mm) break;
    ++kept;
  }
  points.resize(kept);
  std::ranges::copy(followed.points, std::back_inserter(points));
  if (is_first) std::ranges::reverse(points);
  return points;
}

}  // namespace

LongerEnds with_longer_ends(const VesselTree& tree, const ScanOfVessels& scan,
                            const LumenBrightness& brightness, const std::string& name, Progress& progress) {
  progress.begin("following vessels beyond their ends", 1, "passes");
  const TubeQuestions tubes(scan);
  const EndFollower follower(tree, tubes, brightness);
  const std::vector<FreeEnd> ends = free_ends(tree);
  std::vector<std::optional<Followed>> followed(ends.size());
  parallel_for(std::ssize(ends), [&](std::int64_t i) {
    const auto at = static_cast<std::size_t>(i);
    followed[at] = follower.follow(ends[at]);
  });
  std::vector<VesselBranch> branches = tree.branches();
  std::vector<std::vector<VesselPoint>> lines;
  for (std::size_t i = 0; i < ends.size(); ++i) {
    if (!followed[i] ||
        std::ranges::any_of(lines, [&](const auto& line) { return meet(line, followed[i]->points); }))
      continue;
    narrow(followed[i]->points);
    const auto branch = static_cast<std::size_t>(ends[i].branch);
    branches[branch].points =
        continued(tree.branches()[branch], ends[i].is_first, *followed[i], tubes.voxel_mm());
    lines.push_back(std::move(followed[i]->points));
  }
  progress.advance();
  return {VesselTree(std::move(branches), name), std::move(lines)};
}

}  // namespace xraycast
