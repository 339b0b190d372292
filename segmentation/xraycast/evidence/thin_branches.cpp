#include "xraycast/evidence/thin_branches.hpp"

#include "xraycast/evidence/block_filter.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/mask/distance_transform.hpp"

#include <glm/common.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <queue>

namespace xraycast {
namespace {

constexpr double kFine_mm = 1.2, kCoarse_mm = 2.4;

/// A scan smoothed by a Gaussian, in eighths of HU.
class SmoothScan {
 public:
  SmoothScan(const Volume& volume, double sigma_mm, ComputeDevice& device)
      : geometry_(volume.geometry()), sigma_mm_(sigma_mm) {
    const std::vector<float> hu = smoothed(volume, sigma_mm / geometry_.spacing_mm, device);
    eighths_.resize(hu.size());
    std::ranges::transform(hu, eighths_.begin(), [](float v) {
      return static_cast<std::int16_t>(std::lround(std::clamp(v, -kMost_hu, kMost_hu) / kEighth));
    });
  }

  double sigma_mm() const { return sigma_mm_; }
  double hu(std::size_t at) const { return kEighth * eighths_[at]; }

  /// Of a voxel that is not at the scan's side.
  glm::dvec3 slope_per_mm(std::size_t at) const {
    const std::array<std::size_t, 3> step = steps();
    glm::dvec3 slope(0);
    for (int a = 0; a < 3; ++a)
      slope[a] = (hu(at + step[a]) - hu(at - step[a])) / (2 * geometry_.spacing_mm[a]);
    return slope;
  }

  /// The two most negative second derivatives across a tube, per mm2, of a voxel that is not at the scan's
  /// side.
  std::array<double, 2> across(std::size_t at) const {
    const glm::dvec3& s = geometry_.spacing_mm;
    const std::array<std::size_t, 3> step = steps();
    const double here = hu(at);
    std::array<std::array<double, 3>, 3> h{};
    for (int a = 0; a < 3; ++a) {
      h[a][a] = (hu(at + step[a]) + hu(at - step[a]) - 2 * here) / (s[a] * s[a]);
      for (int b = 0; b < a; ++b)
        h[a][b] = (hu(at + step[a] + step[b]) + hu(at - step[a] - step[b]) - hu(at + step[a] - step[b]) -
                   hu(at + step[b] - step[a])) /
                  (4 * s[a] * s[b]);
    }
    return two_least_eigenvalues(h);
  }

 private:
  static constexpr float kMost_hu = 4000, kEighth = 0.125f;

  /// From a voxel to the next one along each axis.
  std::array<std::size_t, 3> steps() const {
    const Index3& size = geometry_.size;
    return {1, static_cast<std::size_t>(size.x), static_cast<std::size_t>(size.x * size.y)};
  }

  /// Of a symmetric matrix, of its lower triangle: the least, and the one in the middle. By angles, O. K.
  /// Smith, Commun ACM 4:168, 1961.
  static std::array<double, 2> two_least_eigenvalues(const std::array<std::array<double, 3>, 3>& h) {
    const double off = h[1][0] * h[1][0] + h[2][0] * h[2][0] + h[2][1] * h[2][1];
    const double mean = (h[0][0] + h[1][1] + h[2][2]) / 3;
    const double x = h[0][0] - mean, y = h[1][1] - mean, z = h[2][2] - mean;
    const double spread = std::sqrt((x * x + y * y + z * z + 2 * off) / 6);
    if (spread == 0) return {mean, mean};
    const double determinant = x * (y * z - h[2][1] * h[2][1]) - h[1][0] * (h[1][0] * z - h[2][1] * h[2][0]) +
                               h[2][0] * (h[1][0] * h[2][1] - y * h[2][0]);
    const double cosine = std::clamp(determinant / (2 * spread * spread * spread), -1.0, 1.0);
    const double angle = std::acos(cosine) / 3;
    const double largest = mean + 2 * spread * std::cos(angle),
                 least = mean + 2 * spread * std::cos(angle + 2 * std::numbers::pi / 3);
    return {least, 3 * mean - largest - least};
  }

  VolumeGeometry geometry_;
  double sigma_mm_;
  std::vector<std::int16_t> eighths_;
};

/// How steeply a scan falls along an axis where it is steepest, within two voxels of a place, per mm; 0 where
/// it does not fall along this axis alone, as at a wall that lies across it.
double steepness(const SmoothScan& fine, const VolumeGeometry& g, const Index3& place, int axis) {
  constexpr double kAlong = 0.3;
  const Index3 out = axis == 0 ? Index3(1, 0, 0) : Index3(0, 1, 0);
  double steepest = 0, aside = 0;
  for (std::int64_t k = -2; k <= 2; ++k) {
    const Index3 at = place + k * out;
    if (at.x < 1 || at.y < 1 || at.x + 1 >= g.size.x || at.y + 1 >= g.size.y) continue;
    const glm::dvec3 slope = fine.slope_per_mm(offset_of(g, at));
    if (std::abs(slope[axis]) <= steepest) continue;
    steepest = std::abs(slope[axis]);
    aside = std::hypot(slope[1 - axis], slope.z);
  }
  return aside < kAlong * steepest ? steepest : 0;
}

/// The standard deviation of a scan's own blur, in mm, by the steepness of its vessels' walls where they lie
/// across rows and columns of slices.
double blur_of(const SmoothScan& fine, const Mask& vessels) {
  constexpr double kUsual_mm = 0.8, kLeast_mm = 0.4, kMost_mm = 1.5, kBeside_mm = 4.5;
  constexpr double kLeastStep_hu = 40;
  constexpr std::size_t kFewest = 100;
  const VolumeGeometry& g = vessels.geometry;
  std::vector<double> found_mm;
  const auto look_across = [&](const Index3& here, int axis, int side) {
    const Index3 out = axis == 0 ? Index3(side, 0, 0) : Index3(0, side, 0);
    if (vessels.at(here + out)) return;
    const auto reach = static_cast<std::int64_t>(std::lround(kBeside_mm / g.spacing_mm[axis]));
    const Index3 inner = here - reach * out, outer = here + reach * out;
    if (!vessels.at(inner) || !vessels.contains(outer) || vessels.at(outer)) return;
    const double fall_hu = fine.hu(offset_of(g, inner)) - fine.hu(offset_of(g, outer));
    if (fall_hu < kLeastStep_hu) return;
    const double steepest = steepness(fine, g, here, axis);
    if (steepest > 0) found_mm.push_back(fall_hu / (std::sqrt(2 * std::numbers::pi) * steepest));
  };
  const std::int64_t slice = g.size.x * g.size.y;
  for (std::int64_t i = slice; i < slice * (g.size.z - 1); ++i)
    if (vessels.voxels[static_cast<std::size_t>(i)] != 0)
      for (const int axis : {0, 1})
        for (const int side : {-1, 1}) look_across(voxel_at(g, i), axis, side);
  if (found_mm.size() < kFewest) return kUsual_mm;
  const auto median = found_mm.begin() + static_cast<std::ptrdiff_t>(found_mm.size() / 2);
  std::ranges::nth_element(found_mm, median);
  const double own = *median * *median - fine.sigma_mm() * fine.sigma_mm();
  return std::clamp(std::sqrt(std::max(0.0, own)), kLeast_mm, kMost_mm);
}

/// A tube through a voxel, as two scales show it.
struct Tube {
  double contrast_hu, lumen_hu, radius_mm;
  double roundness;    ///< 1 for a tube, 0 for a sheet
  double response_hu;  ///< the finer scale's Laplacian across it, in its variances
};

enum class Evidence { none, weak, sure };

/// Tells branches of some vessels from what else is in a scan.
class BranchTest {
 public:
  BranchTest(const Volume& volume, const WideVessels& vessels, ComputeDevice& device)
      : vessels_(vessels),
        fine_(volume, kFine_mm, device),
        coarse_(volume, kCoarse_mm, device),
        blur_mm2_(std::pow(blur_of(fine_, vessels.mask), 2)) {}

  double hu(std::size_t at) const { return fine_.hu(at); }

  /// Thin tubes of that lumen, and what is nearly as bright. Weak: somewhat darker, as noise makes short
  /// pieces of them.
  Evidence of_branch(std::size_t at) const {
    constexpr double kBright = 0.15, kDarkest = 0.6, kLumen = 0.68, kWeakLumen = 0.62, kRound = 0.3,
                     kWeakRound = 0.75, kShortfall = 0.7, kBeyond = 2;
    constexpr double kResponse = 0.15;  // noise and an organ's texture give a third of it
    constexpr double kWidest_mm = 5;
    const double contrast_hu = vessels_.lumen_hu - vessels_.tissue_hu, hu = fine_.hu(at);
    if (hu >= vessels_.lumen_hu - kBright * contrast_hu) return Evidence::sure;
    if (hu < vessels_.tissue_hu - kDarkest * contrast_hu) return Evidence::none;
    const Tube tube = tube_at(at);
    const double lumen = (tube.lumen_hu - vessels_.tissue_hu) / contrast_hu;
    const bool is_tube = tube.response_hu >= kResponse * contrast_hu && tube.roundness >= kRound &&
                         tube.radius_mm <= kWidest_mm && lumen <= 1 + kBeyond &&
                         tube.contrast_hu >= kShortfall * (vessels_.lumen_hu - tube.lumen_hu);
    if (is_tube && lumen >= kLumen) return Evidence::sure;
    return is_tube && lumen >= kWeakLumen && tube.roundness >= kWeakRound ? Evidence::weak : Evidence::none;
  }

 private:
  Tube tube_at(std::size_t at) const {
    constexpr double kLeast_mm2 = 0.25, kMost_mm2 = 36;
    const double fine_mm2 = kFine_mm * kFine_mm + blur_mm2_, coarse_mm2 = kCoarse_mm * kCoarse_mm + blur_mm2_;
    const auto [f1, f2] = fine_.across(at);
    const auto [c1, c2] = coarse_.across(at);
    const double fine = -(f1 + f2) * fine_mm2, coarse = -(c1 + c2) * coarse_mm2;
    if (!(fine > 0 && coarse > 0)) return {0, 0, std::sqrt(kMost_mm2), 0, 0};
    // fine / coarse = coarse_mm2 / fine_mm2 exp(-r^2 / 2 (1 / fine_mm2 - 1 / coarse_mm2))
    const double square_mm2 =
        std::clamp(2 * std::log(coarse_mm2 / fine_mm2 * coarse / fine) / (1 / fine_mm2 - 1 / coarse_mm2),
                   kLeast_mm2, kMost_mm2);
    const double u = square_mm2 / fine_mm2, contrast_hu = fine / (u * std::exp(-u / 2));
    const auto [least, middle] = fine > coarse ? std::array{f1, f2} : std::array{c1, c2};
    return {contrast_hu, fine_.hu(at) + contrast_hu * std::exp(-u / 2), std::sqrt(square_mm2),
            least < 0 ? middle / least : 0, fine};
  }

  const WideVessels& vessels_;
  SmoothScan fine_, coarse_;
  double blur_mm2_;
};

/// What is bright and wide, away from the vessels.
Mask other_wide(const BranchTest& test, const WideVessels& vessels, const std::vector<float>& away_mm) {
  constexpr double kAway_mm = 2.5, kRadius_mm = 3.7;
  Mask bright(vessels.mask.geometry);
  for (std::size_t i = 0; i < away_mm.size(); ++i)
    bright.voxels[i] = static_cast<std::uint8_t>(test.hu(i) >= vessels.others_hu && away_mm[i] > kAway_mm);
  const std::vector<float> depth_mm = distance_to_background_mm(bright);
  for (std::size_t i = 0; i < depth_mm.size(); ++i) bright.voxels[i] = depth_mm[i] >= kRadius_mm;
  return bright;
}

/// Grows vessels and others at once, the brightest voxels first.
class Growth {
 public:
  /// `away_mm`: of each voxel from the vessels.
  Growth(const WideVessels& vessels, const BranchTest& test, const std::vector<float>& away_mm)
      : geometry_(vessels.mask.geometry), test_(test), owner_(vessels.mask.voxels.size(), kNobody) {
    const Mask wide = other_wide(test, vessels, away_mm);
    for (std::size_t i = 0; i < owner_.size(); ++i) {
      if (vessels.mask.voxels[i] != 0)
        owner_[i] = kVessels;
      else if (vessels.excluded.voxels[i] != 0)
        owner_[i] = kNone;
      else if (wide.voxels[i] != 0 || vessels.others.voxels[i] != 0)
        owner_[i] = kOthers;
    }
    start();
  }

  ThinBranches found(const Mask& vessels) {
    constexpr std::size_t kBetweenChecks = 1 << 16;
    for (std::size_t visited = 0; !queue_.empty(); ++visited) {
      if (visited % kBetweenChecks == 0) check_cancelled();
      const Voxel next = queue_.top();
      queue_.pop();
      visit_neighbours(next);
    }
    ThinBranches result{Mask(vessels.geometry), Mask(vessels.geometry)};
    for (std::size_t i = 0; i < owner_.size(); ++i) {
      result.branches.voxels[i] = static_cast<std::uint8_t>(owner_[i] == kVessels && vessels.voxels[i] == 0);
      result.others.voxels[i] = owner_[i] == kOthers;
    }
    return result;
  }

 private:
  enum Owner : std::uint8_t { kNobody, kVessels, kOthers, kNone };
  struct Voxel {
    float level;  ///< the darkest on the way to it
    std::size_t at;
    int weak;  ///< how many voxels of weak evidence the brightest way to it ends in
    bool operator<(const Voxel& other) const { return level < other.level; }
  };

  bool is_inner(const Index3& v) const {
    const Index3& size = geometry_.size;
    return v.x > 0 && v.y > 0 && v.z > 0 && v.x + 1 < size.x && v.y + 1 < size.y && v.z + 1 < size.z;
  }

  /// From the sides of all owners.
  void start() {
    for (std::size_t i = 0; i < owner_.size(); ++i) {
      if (owner_[i] != kVessels && owner_[i] != kOthers) continue;
      const Index3 voxel = voxel_at(geometry_, static_cast<std::int64_t>(i));
      if (!is_inner(voxel) || !is_at_side(voxel)) continue;
      queue_.push({static_cast<float>(test_.hu(i)), i, 0});
    }
  }

  bool is_at_side(const Index3& voxel) const {
    return std::ranges::any_of(
        kNeighbours, [&](const Index3& by) { return owner_[offset_of(geometry_, voxel + by)] == kNobody; });
  }

  void visit_neighbours(const Voxel& from) {
    constexpr int kMostWeak = 5;  // of vessels; others take none, so as not to grow along walls
    const Index3 voxel = voxel_at(geometry_, static_cast<std::int64_t>(from.at));
    for (const Index3& by : kNeighbours) {
      const Index3 next = voxel + by;
      if (!is_inner(next)) continue;
      const std::size_t at = offset_of(geometry_, next);
      if (owner_[at] != kNobody) continue;
      const Evidence evidence = test_.of_branch(at);
      const int weak = evidence == Evidence::weak ? from.weak + 1 : 0;
      const bool goes_on =
          evidence != Evidence::none && weak <= (owner_[from.at] == kVessels ? kMostWeak : 0);
      owner_[at] = goes_on ? owner_[from.at] : static_cast<std::uint8_t>(kNone);
      if (goes_on) queue_.push({std::min(from.level, static_cast<float>(test_.hu(at))), at, weak});
    }
  }

  VolumeGeometry geometry_;
  const BranchTest& test_;
  std::vector<std::uint8_t> owner_;
  std::priority_queue<Voxel> queue_;
};

/// Those that are no roughness of a wall.
Mask reaching(const Mask& branches, const std::vector<float>& away_mm) {
  constexpr float kLeast_mm = 5;
  const Components components(branches);
  std::vector<bool> keep(static_cast<std::size_t>(components.count()));
  for (const Components::Run& run : components.runs())
    for (std::int64_t i = run.first; i < run.first + run.length; ++i)
      if (away_mm[static_cast<std::size_t>(i)] >= kLeast_mm)
        keep[static_cast<std::size_t>(run.component)] = true;
  return components.select(keep);
}

}  // namespace

ThinBranches find_thin_branches(const Volume& volume, const WideVessels& vessels, ComputeDevice& device,
                                Progress& progress) {
  progress.begin("thin branches", 3, "passes");
  const BranchTest test(volume, vessels, device);
  progress.advance();
  const std::vector<float> away_mm = distance_to_foreground_mm(vessels.mask);
  ThinBranches found = Growth(vessels, test, away_mm).found(vessels.mask);
  progress.advance();
  found.branches = reaching(found.branches, away_mm);
  progress.advance();
  return found;
}

}  // namespace xraycast
