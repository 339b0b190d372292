#include "xraycast/fluoroscope/blur_stage.hpp"

#include "xraycast/fluoroscope/pixel_loops.hpp"

#include <cmath>
#include <numbers>
#include <utility>

namespace xraycast {
namespace {

double gaussian_transfer(double cycles, double spread) {
  return std::exp(-2 * std::pow(std::numbers::pi * spread * cycles, 2));
}

SymmetricTaps primary_taps(const CArm& c_arm, double pixel_mm) {
  const double focal = focal_spread_mm(c_arm) / pixel_mm;
  return taps_for([&](double cycles) {
    const double turn = std::numbers::pi * cycles;
    return std::sin(turn) / turn * gaussian_transfer(cycles, focal);
  });
}

SymmetricTaps gaussian_taps(double spread_mm, double pixel_mm) {
  return taps_for([&](double cycles) { return gaussian_transfer(cycles, spread_mm / pixel_mm); });
}

}  // namespace

SeparableFilter::SeparableFilter(const PictureSize& size, SymmetricTaps taps)
    : size_(size), taps_(std::move(taps)), along_rows_(size.pixels()) {}

void SeparableFilter::pass_along(int j, const float* row) {
  const auto count = static_cast<std::size_t>(size_.width);
  const auto margin = static_cast<std::ptrdiff_t>(taps_.size()) - 1;
  thread_local PixelPlane padded;
  padded.resize(count + 2 * static_cast<std::size_t>(margin));
  std::fill_n(padded.begin(), margin, row[0]);
  std::copy_n(row, count, padded.begin() + margin);
  std::fill_n(padded.end() - margin, margin, row[count - 1]);
  filter_row(padded.data(), taps_, size_.width, along_rows_.data() + size_.row(j));
}

void SeparableFilter::add_down(int j, float weight, float* out) const {
  const int neighbours = static_cast<int>(taps_.size()) - 1;
  thread_local std::vector<const float*> rows;
  rows.clear();
  for (int k = -neighbours; k <= neighbours; ++k)
    rows.push_back(along_rows_.data() + size_.row(std::clamp(j + k, 0, size_.height - 1)));
  add_filtered_column(rows.data(), taps_, weight, size_.width, out);
}

BlurStage::BlurStage(const PictureSize& size) : primary(size), size_(size), narrow_(size), wide_({}) {}

BlurStage::BlurStage(const PictureSize& size, double pixel_mm, const CArm& c_arm)
    : primary(size, primary_taps(c_arm, pixel_mm)),
      size_(size),
      narrow_(size, gaussian_taps(c_arm.detector.blur.narrow_mm, pixel_mm)),
      wide_(size, gaussian_taps(c_arm.detector.blur.wide_mm, pixel_mm)),
      wide_share_(static_cast<float>(c_arm.detector.blur.wide_share)) {}

void BlurStage::scintillate_along(int j, const float* energy_kev) {
  narrow_.pass_along(j, energy_kev);
  if (wide_share_ > 0) wide_.pass_along(j, energy_kev);
}

void BlurStage::scintillate_down(int j, float* signal_kev) const {
  std::fill_n(signal_kev, size_.width, 0.0f);
  narrow_.add_down(j, 1 - wide_share_, signal_kev);
  if (wide_share_ > 0) wide_.add_down(j, wide_share_, signal_kev);
}

}  // namespace xraycast
