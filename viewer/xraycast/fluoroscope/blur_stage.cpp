#include "xraycast/fluoroscope/blur_stage.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/fluoroscope/pixel_loops.hpp"

#include <algorithm>
#include <utility>

namespace xraycast {
namespace {

/// How far one of the light's filters, whose weight is `share`, may be off. Together they err by 0.008 of the
/// MTF at most, which leaves the filter before the count 0.008 of the 0.02 that are promised; and by 2 % of
/// it where it is small, down to a twentieth, since the power of noise goes with its square and is promised
/// within 5 %.
ByFrequency light_tolerance(const ScintillatorBlur& blur, double share) {
  return [blur, share](double cycles) {
    constexpr double kHalf = 0.004, kHalfOfMtf = 0.006, kLeastMtf = 0.05, kLeastShare = 0.01;
    const double mtf = std::max(kLeastMtf, light_transfer(cycles, blur));
    return std::min(kHalf, kHalfOfMtf * mtf) / std::max(share, kLeastShare);
  };
}

/// The light weakens what this filter errs by.
ByFrequency primary_tolerance(const ScintillatorBlur& blur) {
  return [blur](double cycles) {
    constexpr double kWithin = 0.008, kLeastMtf = 0.2;
    return kWithin / std::max(kLeastMtf, light_transfer(cycles, blur));
  };
}

/// Filters must not grow without bound.
void check_pixel(const CArm& c_arm, double pixel_mm) {
  constexpr double kMostSpread = 25;  // pixels
  const ScintillatorBlur& blur = c_arm.detector.blur;
  const double widest_mm = std::max({blur.narrow_mm, blur.wide_mm, focal_spread_mm(c_arm)});
  if (!(widest_mm <= kMostSpread * pixel_mm))
    throw InputError(
        "pixels of {:g} mm are too fine for the blur of {}, {:.2g} mm: take pixels of at least {:.2g} mm, or "
        "leave blur out of the stages",
        pixel_mm, c_arm.name, widest_mm, widest_mm / kMostSpread);
}

}  // namespace

EdgeProfile edge_behind_scintillator(const CArm& c_arm, double pixel_mm) {
  check_pixel(c_arm, pixel_mm);
  return EdgeProfile::behind_scintillator(focal_spread_mm(c_arm) / pixel_mm,
                                          in_pixels(c_arm.detector.blur, pixel_mm));
}

SeparableFilter::SeparableFilter(const PictureSize& size, SymmetricTaps taps)
    : size_(size), taps_(std::move(taps)), along_rows_(size.pixels()) {}

void SeparableFilter::pass_along(int j, const float* row) {
  const int width = size_.width, margin = static_cast<int>(taps_.size()) - 1;
  float* const out = along_rows_.data() + size_.row(j);
  // Near both ends the row goes on as it ends.
  const auto filter_end = [&](int first, int end) {
    thread_local PixelPlane padded;
    const int count = end - first + 2 * margin;
    padded.resize(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i)
      padded[static_cast<std::size_t>(i)] = row[std::clamp(first - margin + i, 0, width - 1)];
    filter_row(padded.data(), taps_, end - first, out + first);
  };
  if (width <= 2 * margin) return filter_end(0, width);
  filter_end(0, margin);
  filter_row(row, taps_, width - 2 * margin, out + margin);
  filter_end(width - margin, width);
}

/// Valid until this thread's next call.
const float* const* SeparableFilter::rows_about(int j) const {
  const int neighbours = static_cast<int>(taps_.size()) - 1;
  thread_local std::vector<const float*> rows;
  rows.clear();
  for (int k = -neighbours; k <= neighbours; ++k)
    rows.push_back(along_rows_.data() + size_.row(std::clamp(j + k, 0, size_.height - 1)));
  return rows.data();
}

void SeparableFilter::pass_down(int j, float weight, float* out) const {
  filter_column(rows_about(j), taps_, weight, size_.width, out);
}

void SeparableFilter::add_down(int j, float weight, float* out) const {
  add_filtered_column(rows_about(j), taps_, weight, size_.width, out);
}

BlurStage::BlurStage(const PictureSize& size) : primary(size), size_(size), narrow_(size), wide_({}) {}

BlurStage::BlurStage(const PictureSize& size, double pixel_mm, const CArm& c_arm) : BlurStage(size) {
  check_pixel(c_arm, pixel_mm);
  const ScintillatorBlur blur = in_pixels(c_arm.detector.blur, pixel_mm);
  const auto taps = [&](double spread, double share) {
    return light_taps(spread, light_tolerance(blur, share));
  };
  primary =
      SeparableFilter(size, primary_taps(focal_spread_mm(c_arm) / pixel_mm, blur, primary_tolerance(blur)));
  narrow_ = SeparableFilter(size, taps(blur.narrow_mm, 1 - blur.wide_share));
  wide_ = SeparableFilter(size, taps(blur.wide_mm, blur.wide_share));
  wide_share_ = static_cast<float>(blur.wide_share);
}

void BlurStage::scintillate_along(int j, const float* energy_kev) {
  narrow_.pass_along(j, energy_kev);
  if (wide_share_ > 0) wide_.pass_along(j, energy_kev);
}

void BlurStage::scintillate_down(int j, float* signal_kev) const {
  narrow_.pass_down(j, 1 - wide_share_, signal_kev);
  if (wide_share_ > 0) wide_.add_down(j, wide_share_, signal_kev);
}

}  // namespace xraycast
