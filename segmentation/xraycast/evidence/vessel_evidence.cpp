#include "xraycast/evidence/vessel_evidence.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/memory_limit.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/evidence/block_filter.hpp"
#include "xraycast/evidence/ridge_detection.hpp"
#include "xraycast/evidence/ridge_tracking.hpp"
#include "xraycast/evidence/robust_statistics.hpp"
#include "xraycast/evidence/scan_response.hpp"
#include "xraycast/evidence/voxel_shares.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/mask/distance_transform.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

using Field = std::vector<float>;

/// Calls `change(i)` for all indices of a field, in parallel.
template <typename Change>
void for_each_index(std::size_t count, const Change& change) {
  constexpr std::size_t kPiece = 1 << 16;
  parallel_for(static_cast<std::int64_t>((count + kPiece - 1) / kPiece), [&](std::int64_t piece) {
    const std::size_t first = static_cast<std::size_t>(piece) * kPiece;
    for (std::size_t i = first; i < std::min(first + kPiece, count); ++i) change(i);
  });
}

/// The contrasts whose means are these values.
Field contrasts(Field values, const ScanResponse& response) {
  for_each_index(values.size(), [&](std::size_t i) {
    values[i] = static_cast<float>(response.contrast_hu(static_cast<double>(values[i])));
  });
  return values;
}

/// The contrast that each voxel of a scan shows when it is smoothed by a Gaussian.
Field smoothed_contrast(const Volume& volume, const ScanResponse& response, double smoothing_vox,
                        ComputeDevice& device) {
  return contrasts(smoothed(volume, glm::dvec3(smoothing_vox), device), response);
}

/// What a Gaussian leaves of the standard deviation of white noise.
double left_of_noise(double smoothing_vox) {
  const double along_an_axis = 1 / (2 * std::sqrt(std::numbers::pi) * smoothing_vox);
  return std::pow(std::min(along_an_axis, 1.0), 1.5);
}

/// The most noise that a scan can have, given the scan smoothed by a Gaussian: where most of it is the same
/// value, what differs around vessels is no noise. Three times what is seen, as noise that is cut off spreads
/// less.
double most_noise_hu(const Field& smooth, double smoothing_vox) {
  constexpr double kCutOff = 3;
  return kCutOff * statistics_of(smooth).standard_deviation / left_of_noise(smoothing_vox);
}

bool is_local_maximum(const Mask& grid, const Field& values, const Index3& voxel) {
  const float here = values[grid.offset(voxel)];
  return std::ranges::all_of(kNeighbours, [&](const Index3& step) {
    return !grid.contains(voxel + step) || values[grid.offset(voxel + step)] <= here;
  });
}

/// The middles of certain ridges. A ridge of noise is short, so that detection drops it: in a large scan the
/// strongest of noise would outnumber the middles of a short vessel.
std::vector<MiddleOfVessel> middles_of_vessels(const Mask& ridges, const Field& narrow, const Field& wide,
                                               const Field& strength, double least_strength) {
  std::vector<MiddleOfVessel> middles;
  for (std::size_t i = 0; i < wide.size(); ++i)
    if (ridges.voxels[i] != 0 && static_cast<double>(strength[i]) > least_strength &&
        is_local_maximum(ridges, wide, voxel_at(ridges.geometry, static_cast<std::int64_t>(i))))
      middles.push_back({narrow[i], wide[i], strength[i]});
  return middles;
}

LumenScale measure_scale(const Volume& volume, const ScanResponse& response, const Field& strength,
                         ComputeDevice& device) {
  const Field narrow = smoothed_contrast(volume, response, kNarrow_vox, device),
              wide = smoothed_contrast(volume, response, kWide_vox, device);
  const double least_strength = strong_ridge(strength);
  const Mask ridges = detect_ridges(strength, volume.geometry(), least_strength);
  return measure_lumen_scale(middles_of_vessels(ridges, narrow, wide, strength, least_strength), response,
                             least_strength);
}

/// Voxels of wide vessels, within which ridges fade: half full, and above the noise, in large components.
Mask half_full(const Field& contrast, const LumenScale& scale, const VolumeGeometry& grid) {
  constexpr double kOfNoise = 1.3;  // six standard deviations of noise smoothed by 0.8 voxels
  constexpr std::int64_t kMinVoxels = 14;
  const auto least_hu = static_cast<float>(std::max(0.5 * scale.lumen_hu, kOfNoise * scale.noise_hu));
  Mask mask(grid);
  for_each_index(contrast.size(),
                 [&](std::size_t i) { mask.voxels[i] = static_cast<std::uint8_t>(contrast[i] > least_hu); });
  return large_components(mask, kMinVoxels);
}

/// Voxels near a mask, within `reach_vox` voxels of the isotropic kind.
Mask near(Mask mask, double reach_vox) {
  mask.geometry.spacing_mm = glm::dvec3(1);
  const Field away = distance_to_foreground_mm(mask);
  for_each_index(away.size(), [&](std::size_t i) {
    mask.voxels[i] = static_cast<std::uint8_t>(static_cast<double>(away[i]) <= reach_vox);
  });
  return mask;
}

/// Values within a box of a grid, x fastest.
Field cropped(const Field& values, const VolumeGeometry& grid, const Box& box) {
  const Index3 size = grid.size;
  Field part;
  part.reserve(static_cast<std::size_t>((box.upper.x - box.lower.x) * (box.upper.y - box.lower.y) *
                                        (box.upper.z - box.lower.z)));
  for (std::int64_t z = box.lower.z; z < box.upper.z; ++z)
    for (std::int64_t y = box.lower.y; y < box.upper.y; ++y) {
      const auto row = values.begin() + (z * size.y + y) * size.x + box.lower.x;
      part.insert(part.end(), row, row + (box.upper.x - box.lower.x));
    }
  return part;
}

/// A Gaussian smooths a box of values.
class Smoother {
 public:
  Smoother(ComputeDevice& device, const Index3& size) : block_(device, size) {}
  Field operator()(const Field& values, double sigma_vox) {
    return block_.download(block_.smooth(block_.upload(values), glm::dvec3(sigma_vox)));
  }

 private:
  BlockFilter block_;
};

/// Fractions deblurred by Richardson and Lucy's iteration, which keeps their sum, up to full.
Field deblurred(const Field& fractions, double blur_vox, int steps, Smoother& smooth) {
  constexpr float kLeast = 1e-4F;
  constexpr double kSharp_vox = 0.15;
  Field result = fractions;
  for (int step = 0; step < steps && blur_vox > kSharp_vox; ++step) {
    Field ratio = smooth(result, blur_vox);
    for_each_index(ratio.size(), [&](std::size_t i) { ratio[i] = fractions[i] / (ratio[i] + kLeast); });
    ratio = smooth(ratio, blur_vox);
    for_each_index(ratio.size(), [&](std::size_t i) { result[i] = std::min(result[i] * ratio[i], 1.0F); });
  }
  return result;
}

/// Gives what the vessels' light outside of `mask` holds to the voxels in it, so that fractions add up to the
/// volume. Twice: what a full voxel cannot take goes to others nearby.
Field conserved(Field fractions, const Mask& mask, const Field& light, Smoother& smooth) {
  constexpr double kAround_vox = 2;
  constexpr float kMost = 2, kLeast = 1e-3F;
  const Field near_light = smooth(light, kAround_vox);
  for_each_index(fractions.size(), [&](std::size_t i) {
    if (mask.voxels[i] == 0) fractions[i] = 0;
  });
  for (int pass = 0; pass < 2; ++pass) {
    const Field held = smooth(fractions, kAround_vox);
    for_each_index(fractions.size(), [&](std::size_t i) {
      const float ratio = std::clamp(near_light[i] / std::max(held[i], kLeast), 1.0F, kMost);
      fractions[i] = std::min(fractions[i] * ratio, 1.0F);
    });
  }
  return fractions;
}

/// The voxels of vessels wider than four voxels' radius, with those at their wall.
Mask wide_vessels(const Mask& candidates, const Field& fractions) {
  constexpr double kWideRadius_vox = 4, kWall_vox = 1.5;
  Mask core(candidates.geometry);
  core.geometry.spacing_mm = glm::dvec3(1);
  for_each_index(fractions.size(),
                 [&](std::size_t i) { core.voxels[i] = static_cast<std::uint8_t>(fractions[i] >= 0.5F); });
  const Field depth = distance_to_background_mm(core);
  for_each_index(fractions.size(), [&](std::size_t i) {
    core.voxels[i] = static_cast<std::uint8_t>(static_cast<double>(depth[i]) >= kWideRadius_vox);
  });
  return core.count() == 0 ? Mask(candidates.geometry) : near(core, kWideRadius_vox + kWall_vox);
}

/// What is known of the lumen in the voxels of a box.
struct LumenEstimate {
  Field fractions;
  Field evidence;         ///< of lumen: the fractions, or probabilities
  double least, certain;  ///< evidence of a voxel of lumen, and of one that noise does not make
  bool is_deblurred;      ///< so that vessels wider than four voxels' radius end where voxels are half full
};

/// Judges voxels by the evidence of lumen in them.
class LumenJudge {
 public:
  LumenJudge(const Mask& candidates, const LumenEstimate& estimate)
      : candidates_(candidates),
        wide_(estimate.is_deblurred ? wide_vessels(candidates, estimate.fractions)
                                    : Mask(candidates.geometry)),
        estimate_(estimate) {}

  bool is_certain(std::size_t i) const { return evidence(i) >= estimate_.certain; }

  /// Whether a voxel of a skeleton holds almost as much as is needed.
  bool is_bright(std::size_t i) const {
    constexpr double kAlmost = 0.8;
    return evidence(i) >= kAlmost * estimate_.least;
  }

  /// Whether a voxel on a candidate or beside one holds enough. A neighbour of a half full one needs less, as
  /// its evidence is less likely to be noise.
  bool is_lumen(std::size_t i) const {
    constexpr double kLess = 0.95, kMore = 1.05;
    if (evidence(i) < kLess * estimate_.least) return false;
    const Index3 voxel = voxel_at(candidates_.geometry, static_cast<std::int64_t>(i));
    if (!is_by_a_candidate(i, voxel)) return false;
    if (wide_.voxels[i] != 0) return fraction(i) >= kHalf;
    return evidence(i) >= (has_half_full_neighbour(voxel) ? kLess : kMore) * estimate_.least;
  }

 private:
  static constexpr double kHalf = 0.5;

  double fraction(std::size_t i) const { return static_cast<double>(estimate_.fractions[i]); }
  double evidence(std::size_t i) const { return static_cast<double>(estimate_.evidence[i]); }

  bool has_half_full_neighbour(const Index3& voxel) const {
    return std::any_of(kNeighbours.begin(), kNeighbours.begin() + 6, [&](const Index3& step) {
      return candidates_.contains(voxel + step) && fraction(candidates_.offset(voxel + step)) >= kHalf;
    });
  }

  bool is_by_a_candidate(std::size_t i, const Index3& voxel) const {
    return candidates_.voxels[i] != 0 ||
           std::any_of(kNeighbours.begin(), kNeighbours.begin() + (is_certain(i) ? 26 : 18),
                       [&](const Index3& step) { return candidates_.at(voxel + step); });
  }

  const Mask& candidates_;
  Mask wide_;
  const LumenEstimate& estimate_;
};

/// The voxels beside candidates that hold enough lumen, but not those of pruned spurs unless they are
/// certain; and the skeleton: what is bright of it, and of the rest what joins such parts.
Mask lumen_mask(const PrunedSkeleton& skeleton, const Mask& candidates, const LumenEstimate& estimate) {
  const LumenJudge judge(candidates, estimate);
  const Field to_kept_mm = distance_to_foreground_mm(skeleton.kept),
              to_pruned_mm = distance_to_foreground_mm(skeleton.pruned);
  Mask vessels(candidates.geometry), faint(candidates.geometry);
  for_each_index(estimate.fractions.size(), [&](std::size_t i) {
    (judge.is_bright(i) ? vessels : faint).voxels[i] = skeleton.kept.voxels[i];
    if ((judge.is_certain(i) || to_pruned_mm[i] >= to_kept_mm[i]) && judge.is_lumen(i)) vessels.voxels[i] = 1;
  });
  subtract(faint, vessels);
  return with_weak_links(vessels, faint);
}

/// Fractions from 0 to 1 of what a contrast is of the lumen's, and nothing beyond `reach`.
Field fractions_within(Field contrast, const Mask& reach, double lumen_hu) {
  for_each_index(contrast.size(), [&](std::size_t i) {
    contrast[i] = reach.voxels[i] == 0
                      ? 0
                      : static_cast<float>(std::clamp(static_cast<double>(contrast[i]) / lumen_hu, 0.0, 1.0));
  });
  return contrast;
}

/// Ridges and half full voxels.
Mask find_candidates(const Volume& volume, const LumenScale& scale, const Field& strength,
                     const Field& contrast, ComputeDevice& device) {
  constexpr double kTracking_vox = 0.7;
  Mask ridges = detect_ridges(strength, volume.geometry(), kLeastRidge * scale.lumen_hu);
  const Mask tracks =
      track_ridges(contrast_to_noise(volume, kTracking_vox, device, least_unit_hu(scale.lumen_hu)), ridges);
  const Mask full = half_full(contrast, scale, volume.geometry());
  unite(ridges, tracks);
  unite(ridges, full);
  return ridges;
}

/// The fractions of a box of the scan, smoothed by as much as its noise asks for, and deblurred.
Field estimated_fractions(const Volume& volume, const ScanResponse& response, const LumenScale& scale,
                          const Box& box, const Mask& reach, Smoother& smooth, ComputeDevice& device) {
  const double smoothing = smoothing_vox(scale);
  const int steps = 3 + static_cast<int>(std::lround(3 * std::min(scale.blur_vox, 1.0)));
  const Field fractions = fractions_within(
      cropped(smoothed_contrast(volume, response, smoothing, device), volume.geometry(), box), reach,
      scale.lumen_hu);
  return deblurred(fractions, std::hypot(smoothing, scale.blur_vox), steps, smooth);
}

/// The part of a scan in a box.
Volume cropped(const Volume& volume, const Box& box) {
  VolumeGeometry grid = volume.geometry();
  grid.size = box.upper - box.lower;
  Volume part(grid);
  for_each_voxel({Index3(0), grid.size}, [&](const Index3& v) {
    const Index3 there = v + box.lower;
    part.at(v.x, v.y, v.z) = volume.at(there.x, there.y, there.z);
  });
  return part;
}

/// The lumen by each voxel's own value in sharp and quiet scans, and in those whose voxels are mostly full or
/// empty: smoothing and deblurring would make voxels beside a vessel look partly full. Of thin vessels in
/// more noise they tell more.
LumenEstimate estimated_lumen(const Volume& volume, const ScanResponse& response, const LumenScale& scale,
                              const Box& box, const Mask& reach, Smoother& smooth, ComputeDevice& device) {
  constexpr double kSharp_vox = 0.3, kQuiet = 0.07, kFewPartial = 0.33, kSomePartial = 0.45;
  constexpr double kLeast = 0.4;  // about as many voxels are wrong as are missing
  const bool is_sharp_and_quiet = scale.blur_vox <= kSharp_vox && scale.noise() <= kQuiet;
  VoxelShares shares = voxel_shares(cropped(volume, box), reach,
                                    {scale.lumen_hu, response.noise_hu(), response.background_hu()});
  if (shares.partial <= (is_sharp_and_quiet ? kSomePartial : kFewPartial))
    return {std::move(shares.fraction), std::move(shares.probability), kLeast, kLeast, false};
  Field fractions = estimated_fractions(volume, response, scale, box, reach, smooth, device);
  Field evidence = fractions;
  return {std::move(fractions), std::move(evidence), least_fraction(scale), certain_fraction(scale), true};
}

/// Writes the fractions of the vessels in a box.
void set_fractions(const Field& fractions, const Mask& vessels, const Box& box, LumenFill& fill) {
  for (std::size_t i = 0; i < fractions.size(); ++i) {
    if (vessels.voxels[i] == 0) continue;
    const Index3 voxel = voxel_at(vessels.geometry, static_cast<std::int64_t>(i)) + box.lower;
    fill.fractions[offset_of(fill.geometry, voxel)] = quantised_fraction(static_cast<double>(fractions[i]));
  }
}

/// Up to thirteen fields at once, with the device's.
void require_memory_of_fields(const VolumeGeometry& grid) {
  constexpr std::int64_t kBytesPerVoxel = 52;
  const std::int64_t bytes = kBytesPerVoxel * grid.voxel_count();
  try {
    require_memory(
        fmt::format("finding vessels in {} x {} x {} voxels", grid.size.x, grid.size.y, grid.size.z),
        {bytes, bytes});
  } catch (const Error& e) {
    throw Error("{}; or give a window, which needs less", e.what());
  }
}

}  // namespace

double smoothing_vox(const LumenScale& scale) {
  constexpr double kMost_vox = 0.8, kHalfway = 0.025, kLeast_vox = 0.1;
  const double noise2 = scale.noise() * scale.noise();
  return std::max(kMost_vox * noise2 / (noise2 + kHalfway * kHalfway), kLeast_vox);
}

double least_fraction(const LumenScale& scale) {
  const double blur3 = std::pow(std::hypot(smoothing_vox(scale), scale.blur_vox), 3);
  return 0.042 + 0.13 * blur3 / (blur3 + 0.25) + 0.22 * std::min(scale.noise(), 0.2);
}

double certain_fraction(const LumenScale& scale) {
  constexpr double kDeviations = 2;
  return least_fraction(scale) + kDeviations * scale.noise() * left_of_noise(smoothing_vox(scale));
}

VesselEvidence vessel_evidence(const Volume& volume, double noise_hu, ComputeDevice& device,
                               Progress& progress) {
  constexpr double kLight_vox = 0.8, kNear_vox = 3.5;
  const VolumeGeometry& grid = volume.geometry();
  require_memory_of_fields(grid);
  progress.begin("detecting ridges", 3, "passes");
  Field contrast = smoothed(volume, glm::dvec3(kLight_vox), device);
  const ScanResponse response(volume, std::min(noise_hu, most_noise_hu(contrast, kLight_vox)));
  contrast = contrasts(std::move(contrast), response);
  Field strength = ridge_strength(volume, device);
  progress.advance();
  const LumenScale scale = measure_scale(volume, response, strength, device);
  progress.advance();
  const Mask candidates = find_candidates(volume, scale, strength, contrast, device);
  strength = {};
  progress.advance();
  VesselEvidence found{Mask(grid), LumenFill(grid), scale};
  found.fill.is_of_touched_voxels = true;
  const Box box = grown(bounding_box(candidates), 6, grid.size);
  if (box.empty()) return found;

  progress.begin("estimating the lumen", 3, "passes");
  const PrunedSkeleton skeleton = pruned_skeleton(
      candidates, contrast_to_noise(volume, kLight_vox, device, least_unit_hu(scale.lumen_hu)));
  progress.advance();
  const Mask part = crop(candidates, box), reach = near(part, kNear_vox);
  Smoother smooth(device, part.geometry.size);
  const Field light = fractions_within(cropped(contrast, grid, box), reach, scale.lumen_hu);
  contrast = {};
  LumenEstimate estimate = estimated_lumen(volume, response, scale, box, reach, smooth, device);
  progress.advance();
  const Mask vessels = lumen_mask({crop(skeleton.kept, box), crop(skeleton.pruned, box)}, part, estimate);
  const Field fractions = conserved(std::move(estimate.fractions), vessels, light, smooth);
  paste(vessels, box, found.vessels);
  set_fractions(fractions, vessels, box, found.fill);
  progress.advance();
  return found;
}

}  // namespace xraycast
