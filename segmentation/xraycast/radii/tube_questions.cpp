#include "xraycast/radii/tube_questions.hpp"

#include "xraycast/evidence/robust_statistics.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace xraycast {

TubeQuestions::TubeQuestions(const ScanOfVessels& scan) : scan_(scan) {
  const glm::dvec3 s = scan.volume.geometry().spacing_mm;
  voxel_mm_ = std::cbrt(s.x * s.y * s.z);
  voxel_variance_mm2_ = s * s / 12.0;
}

double TubeQuestions::window_mm(double radius_mm) const {
  constexpr double kShort_vox = 2.5, kLong_vox = 4;
  return std::clamp(5 * voxel_mm_ - 2 * radius_mm, kShort_vox * voxel_mm_, kLong_vox * voxel_mm_);
}

double TubeQuestions::across_mm(double blur_mm, const glm::dvec3& tangent) const {
  const glm::dvec3 v = voxel_variance_mm2_;
  const double own_mm2 = 0.5 * (v.x + v.y + v.z - glm::dot(tangent, v * tangent));
  return std::sqrt(blur_mm * blur_mm + own_mm2);
}

bool TubeQuestions::is_round(double blur_mm, const glm::dvec3& u, const glm::dvec3& v) const {
  constexpr double kMostRatio = 2.2;
  const glm::dvec3 own = voxel_variance_mm2_;
  const double uu = blur_mm * blur_mm + glm::dot(u, own * u), vv = blur_mm * blur_mm + glm::dot(v, own * v),
               uv = glm::dot(u, own * v), middle = 0.5 * (uu + vv), half = std::hypot(0.5 * (uu - vv), uv);
  return middle + half < kMostRatio * kMostRatio * (middle - half);
}

std::optional<GuessedTube> TubeQuestions::guess(std::span<const SampleAcross> samples,
                                                double radius_mm) const {
  constexpr double kInside_vox = 2, kOutside_vox = 1.2;
  const double inside_mm = std::max(0.5 * radius_mm + 0.3 * voxel_mm_, radius_mm - kInside_vox * voxel_mm_);
  std::vector<double> inside, outside;
  std::array<std::vector<double>, Tube::kDirections> outside_each;
  for (const SampleAcross& s : samples) {
    const double mm = glm::length(s.at_mm);
    if (mm < inside_mm) inside.push_back(seen_hu(s.hu));
    if (mm <= radius_mm + kOutside_vox * voxel_mm_) continue;
    outside.push_back(seen_hu(s.hu));
    outside_each[nearest_direction(s.at_mm)].push_back(seen_hu(s.hu));
  }
  if (inside.empty() || outside.empty()) return std::nullopt;
  const bool has_background = scan_.response != nullptr;
  GuessedTube found{quantile(inside, 0.6), has_background ? 0 : quantile(outside, 0.4)};
  if (!(found.contrast_hu() > 0)) return std::nullopt;
  for (std::size_t k = 0; k < Tube::kDirections; ++k)
    found.each_around_hu[k] =
        outside_each[k].empty() || has_background ? found.around_hu : quantile(outside_each[k], 0.5);
  return found;
}

TubeQuestion TubeQuestions::question(const GuessedTube& guessed, double across_mm, double radius_mm) const {
  constexpr double kUneven = 0.08;  // lumen and surroundings, of the contrast
  // A border of two tissues, blurred, or a thin layer: a hundred HU within a few voxels.
  constexpr double kSlope_hu_per_vox = 25;
  constexpr Known kZero{0, 0};
  const double contrast_hu = guessed.contrast_hu();
  TubeQuestion q{across_mm,
                 std::max(std::hypot(scan_.noise_hu, kUneven * contrast_hu), 1.0),
                 scan_.response,
                 {radius_mm, 0, guessed.lumen_hu, {0, 0}, guessed.each_around_hu}};
  q.taper = q.off_x = q.off_y = kZero;
  if (scan_.response != nullptr) {
    q.is_even = true;
    q.around = {0, kUneven * contrast_hu};
  } else {
    q.slope = {0, kSlope_hu_per_vox / voxel_mm_};
  }
  return q;
}

bool TubeQuestions::is_explained(const TubeAnswer& found) const {
  constexpr double kShareIn = 0.7, kUneven = 0.12, kTimesNoise = 1.5;
  const double contrast_hu = found.tube.contrast_hu();
  return contrast_hu > scan_.noise_hu && found.share_in > kShareIn &&
         found.rms_hu < kTimesNoise * std::hypot(scan_.noise_hu, kUneven * contrast_hu);
}

double TubeQuestions::misfit(const TubeAnswer& found) const {
  return std::max(1.0, found.rms_hu / std::max(scan_.noise_hu, 1.0));
}

}  // namespace xraycast
