#include "xraycast/evidence/lumen_scale.hpp"

#include "xraycast/evidence/robust_statistics.hpp"
#include "xraycast/evidence/scan_response.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

namespace xraycast {
namespace {

/// The variance of a voxel's own width, along each axis.
constexpr double kVoxel = 1.0 / 12;

double variance(double smoothing_vox, double blur2) { return smoothing_vox * smoothing_vox + kVoxel + blur2; }

/// Half the square of the radius whose two contrasts have a quotient; it falls as vessels widen.
double half_square_radius(double quotient, double blur2) {
  double low = 1e-3, high = 100;
  for (int pass = 0; pass < 60; ++pass) {
    const double u = std::sqrt(low * high), here = std::expm1(-u / variance(kNarrow_vox, blur2)) /
                                                   std::expm1(-u / variance(kWide_vox, blur2));
    (here > quotient ? low : high) = u;
  }
  return low;
}

/// Whether middles are so few that they may be one vessel's.
bool are_few(std::size_t middles) { return middles < 100; }

/// How many of the brightest middles tell the lumen's contrast: a tenth, but of a few the more, as the
/// brightest of these are so by noise.
std::size_t count_of_brightest(std::size_t middles) {
  constexpr std::size_t kOfFew = 40;
  return are_few(middles) ? std::min(middles, kOfFew) : middles / 10;
}

/// The blur's variance, from vessels that are neither full nor lost in noise.
double measure_blur2(const std::vector<MiddleOfVessel>& middles, double lumen_hu, double before) {
  // Voxels' centres lie off the vessels' middles: without a blur of its own, a scan has this much less.
  constexpr double kOffMiddle = 0.04, kFaint = 0.1, kFaintWide = 0.05, kFull = 0.9, kMax = 4;
  std::vector<double> quotients;
  std::size_t full = 0;
  for (const MiddleOfVessel& m : middles) {
    const double narrow = m.narrow_hu / lumen_hu, wide = m.wide_hu / lumen_hu;
    if (narrow >= kFull) ++full;
    if (narrow > kFaint && narrow < kFull && wide > kFaintWide && wide < kFull)
      quotients.push_back(std::log1p(-wide) / std::log1p(-narrow));
  }
  // Where most of a few are full, the others are full too, and fainter by noise or off their middles.
  if (quotients.empty() || (are_few(middles.size()) && quotients.size() < full)) return before;
  const double rho = quantile(std::move(quotients), 0.5);
  if (rho >= 1) return kMax;
  return std::clamp((rho * variance(kWide_vox, 0) - variance(kNarrow_vox, 0)) / (1 - rho) + kOffMiddle, 0.0,
                    kMax);
}

/// The lumen's contrast, from the brightest of the vessels.
double measure_lumen_hu(const std::vector<MiddleOfVessel>& middles, double blur2) {
  std::vector<double> narrow_hu, of_wide_hu, quotients;
  for (const MiddleOfVessel& m : middles) narrow_hu.push_back(m.narrow_hu);
  const double fraction =
      static_cast<double>(count_of_brightest(middles.size())) / static_cast<double>(middles.size());
  const double least_hu = quantile(narrow_hu, 1 - fraction);
  for (const MiddleOfVessel& m : middles)
    if (m.narrow_hu >= least_hu) {
      of_wide_hu.push_back(m.narrow_hu);
      quotients.push_back(m.narrow_hu / std::max(m.wide_hu, 1e-3));
    }
  const double u = half_square_radius(quantile(std::move(quotients), 0.5), blur2),
               lumen_hu =
                   quantile(std::move(of_wide_hu), 0.5) / -std::expm1(-u / variance(kNarrow_vox, blur2));
  // The model's say ends where vessels are much darker or brighter than any that was seen.
  return std::clamp(lumen_hu, quantile(narrow_hu, 0.95), 1.6 * quantile(narrow_hu, 0.98));
}

/// A first guess of the lumen's contrast: the brightest middles are almost full, whatever fraction of the
/// scan vessels fill.
double bright_hu(const std::vector<MiddleOfVessel>& middles) {
  constexpr std::size_t kOfMany = 20;
  std::vector<double> narrow_hu;
  for (const MiddleOfVessel& m : middles) narrow_hu.push_back(m.narrow_hu);
  std::ranges::sort(narrow_hu, std::greater());
  narrow_hu.resize(are_few(narrow_hu.size()) ? count_of_brightest(narrow_hu.size()) : kOfMany);
  return quantile(std::move(narrow_hu), 0.5);
}

}  // namespace

LumenScale measure_lumen_scale(const std::vector<MiddleOfVessel>& middles, const ScanResponse& response,
                               double least_strength) {
  const double most_hu = std::max(response.largest_hu(), 1.0);
  double lumen_hu = middles.empty() ? most_hu : std::clamp(bright_hu(middles), 1.0, most_hu), blur2 = 0;
  for (int pass = 0; pass < 4; ++pass) {
    std::vector<MiddleOfVessel> strong;
    for (const MiddleOfVessel& m : middles)
      if (m.strength > std::max(least_strength, kLeastRidge * lumen_hu) && m.wide_hu > 0) strong.push_back(m);
    if (strong.empty()) break;
    blur2 = measure_blur2(strong, lumen_hu, blur2);
    lumen_hu = std::clamp(measure_lumen_hu(strong, blur2), 1.0, most_hu);
  }
  return {lumen_hu, response.noise_hu(), std::sqrt(blur2)};
}

}  // namespace xraycast
