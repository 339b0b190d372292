#include "xraycast/display/display_chain.hpp"

#include "xraycast/display/display_loops.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

/// Of the logarithm, from black to white, without compression; chosen by eye.
constexpr float kWindowWidth = 2.4f;

}  // namespace

DisplayChain::DisplayChain(const PictureSize& size, double pixel_mm, double compression)
    : size_(size),
      starved_(size),
      between_blades_(size),
      edges_(size, pixel_mm),
      enhanced_(size.pixels()),
      filter_(size) {
  if (compression > 0) compression_.emplace(size, pixel_mm, compression);
}

void DisplayChain::forget() {
  filter_.forget();
  if (compression_) compression_->window.forget();
}

void DisplayChain::set_codes(int bits, const CodeNoise& noise) {
  starved_.set_noise(noise);
  const bool is_there = bits == bits_ && noise.dark == noise_.dark;
  bits_ = bits;
  noise_ = noise;
  if (is_there) return;
  logarithms_.resize(std::size_t{1} << bits);
  for (std::size_t code = 0; code < logarithms_.size(); ++code)
    logarithms_[code] = std::log(std::max(1.0f, static_cast<float>(code) - noise.dark));
}

void DisplayChain::take_logarithm(const std::uint16_t* codes, int count, float* logarithm) const {
  for (int i = 0; i < count; ++i) logarithm[i] = logarithms_[codes[i]];
}

void DisplayChain::show(const Detected& detected, const Levels& levels, bool is_recording, bool is_processed,
                        std::uint8_t* grey) {
  const PixelPlane& calmed = is_processed && detected.codes
                                 ? starved_.calmed(*detected.codes, detected.logarithm)
                                 : detected.logarithm;
  // Behind the blades there is little light, and its noise, which compression would make bright.
  const PixelPlane& logarithm = is_processed ? between_blades_.continued(calmed, detected.field) : calmed;
  const bool compresses = is_processed && compression_;
  if (compresses) compression_->compress(logarithm, detected.left, detected.field, levels);
  const PixelPlane* shown = compresses ? &compression_->picture : &logarithm;
  if (is_processed) {
    edges_.enhance(*shown, enhanced_);
    between_blades_.shade(detected.field, enhanced_);
    if (is_recording) filter_.forget();
    filter_.add(enhanced_);
    shown = &filter_.average();
  }
  constexpr float kMiddle = 127.5f, kPerLog = 255 / kWindowWidth;
  const GreyLine fixed{kPerLog, kMiddle - kPerLog * static_cast<float>(levels.measured)},
      body = compresses ? compression_->window.body() : fixed,
      metal = compresses ? compression_->window.metal() : fixed;
  for_bands(size_, [&](int first, int end) {
    for (int j = first; j < end; ++j)
      windowed_row(shown->data() + size_.row(j), body, metal, size_.width, grey + size_.row(j));
  });
}

DisplayChain::Compression::Compression(const PictureSize& of_pictures, double pixel_mm, double share)
    : size(of_pictures),
      strength(static_cast<float>(share)),
      range(size, pixel_mm),
      window(size),
      picture(size.pixels()) {}

void DisplayChain::Compression::compress(const PixelPlane& logarithm, const PixelPlane& left,
                                         const PixelPlane& field, const Levels& levels) {
  range.measure(logarithm);
  window.begin(levels.open, left, field);
  const auto middle = static_cast<float>(levels.measured);
  for_bands(size, [&](int first, int end) {
    for (int j = first; j < end; ++j) {
      const std::size_t at = size.row(j);
      range.compress_row(j, logarithm.data() + at, strength, middle, picture.data() + at);
      window.count_row(j, logarithm.data() + at, picture.data() + at, left.data() + at, field.data() + at);
    }
  });
  window.follow();
}

}  // namespace xraycast
