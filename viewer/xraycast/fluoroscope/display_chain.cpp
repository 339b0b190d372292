#include "xraycast/fluoroscope/display_chain.hpp"

#include "xraycast/fluoroscope/pixel_loops.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace xraycast {
namespace {

// Chosen by eye: units' settings are not published.
constexpr float kEdgeStrength = 0.7f;
constexpr float kNewFrameWeight =
    0.4f;  // of fluoroscopy's recursive filter: a quarter of the noise's variance stays
constexpr float kWindowWidth = 2.4f;  // of the logarithm, from black to white

/// At an end of a row, beyond which the picture goes on as it ends.
float sharpened_end(const std::array<const float*, 3>& rows, int column, int width) {
  std::array<std::array<float, 3>, 3> around{};
  for (std::size_t j = 0; j < 3; ++j)
    for (int i = 0; i < 3; ++i)
      around[j][static_cast<std::size_t>(i)] = rows[j][std::clamp(column + i - 1, 0, width - 1)];
  float sharpened = 0;
  sharpened_row(around[0].data(), around[1].data(), around[2].data(), kEdgeStrength, 1, &sharpened);
  return sharpened;
}

}  // namespace

void DisplayChain::restart(int width, int height) {
  width_ = width;
  height_ = height;
  is_first_ = true;
  filtered_.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
}

void DisplayChain::set_codes(int bits, float dark) {
  if (bits == bits_ && dark == dark_) return;
  bits_ = bits;
  dark_ = dark;
  logarithms_.resize(std::size_t{1} << bits);
  for (std::size_t code = 0; code < logarithms_.size(); ++code)
    logarithms_[code] = std::log(std::max(1.0f, static_cast<float>(code) - dark));
}

void DisplayChain::take_logarithm(const std::uint16_t* codes, int count, float* logarithm) const {
  for (int i = 0; i < count; ++i) logarithm[i] = logarithms_[codes[i]];
}

void DisplayChain::begin(bool is_recording, bool is_processed) {
  is_processed_ = is_processed;
  weight_ = is_first_ || is_recording || !is_processed ? 1 : kNewFrameWeight;
}

void DisplayChain::show_row(const std::vector<float>& logarithm, int row, std::uint8_t* grey) {
  const auto width = static_cast<std::size_t>(width_);
  const auto row_at = [&](int j) {
    return logarithm.data() + static_cast<std::size_t>(std::clamp(j, 0, height_ - 1)) * width;
  };
  float* const shown = filtered_.data() + static_cast<std::size_t>(row) * width;
  const float* now = logarithm.data() + static_cast<std::size_t>(row) * width;
  thread_local std::vector<float> sharp;
  sharp.resize(width);
  if (is_processed_) {
    const std::array<const float*, 3> rows{row_at(row - 1), now, row_at(row + 1)};
    sharpened_row(rows[0], rows[1], rows[2], kEdgeStrength, width_ - 2, sharp.data() + 1);
    sharp.front() = sharpened_end(rows, 0, width_);
    sharp.back() = sharpened_end(rows, width_ - 1, width_);
    now = sharp.data();
  }
  if (weight_ == 1)
    std::copy_n(now, width, shown);
  else
    recursive_row(now, weight_, width_, shown);
  constexpr float kMiddle = 127.5f, kWhite = 255;
  constexpr float kPerLog = kWhite / kWindowWidth;
  windowed_row(shown, kPerLog, kMiddle - kPerLog * static_cast<float>(level_), width_, grey);
}

}  // namespace xraycast
