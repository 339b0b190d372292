#include "xraycast/fluoroscope/measuring_field.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>

namespace xraycast {

MeasuringField::MeasuringField(const PixelPlane& field, const PictureSize& size, const PictureSize& detector)
    : every_(4), bands_(static_cast<std::size_t>(size.bands())) {
  const int height = std::min(size.height, detector.height), width = std::min(size.width, detector.width);
  const int above = (size.height - height) / 2, beside = (size.width - width) / 2;
  first_row_ = above + (height + 3) / 4;
  end_row_ = above + (3 * height + 3) / 4;
  first_column_ = beside + width / 4;
  end_column_ = beside + 3 * width / 4;
  if (pixels_in(field, size) > 0) return;
  first_row_ = first_column_ = 0;
  end_row_ = size.height;
  end_column_ = size.width;
  every_ = 1;
  is_weighted_ = true;
  constexpr double kLeastPixels = 0.01;
  if (pixels_in(field, size) < kLeastPixels)
    throw InputError("the collimator leaves none of the picture's {} x {} pixels open; open its blades",
                     size.width, size.height);
}

double MeasuringField::pixels_in(const PixelPlane& field, const PictureSize& size) const {
  double pixels = 0;
  for (int j = first_row_; j < end_row_; j += every_)
    for (int i = first_column_; i < end_column_; ++i)
      pixels += weight(field[size.row(j) + static_cast<std::size_t>(i)]);
  return pixels;
}

void MeasuringField::Sum::operator+=(const Sum& other) {
  signal += other.signal;
  pixels += other.pixels;
}

void MeasuringField::measure_row(int j, const float* signal, const float* left, const float* field) {
  if (!has_row(j)) return;
  constexpr float kOpen = 0.7f;  // some 2 cm of water
  Sums sums;
  for (int i = first_column_; i < end_column_; ++i) {
    const float share = weight(field[i]);
    Sum& sum = left[i] < kOpen ? sums.body : sums.open;
    sum.signal += share * signal[i];
    sum.pixels += share * share;
  }
  Sums& band = bands_[static_cast<std::size_t>(j / PictureSize::kBand)];
  band.body += sums.body;
  band.open += sums.open;
}

double MeasuringField::take_mean() {
  Sums all;
  for (Sums& band : bands_) {
    all.body += band.body;
    all.open += band.open;
    band = {};
  }
  constexpr double kLeastShare = 0.02;  // fewer are the rim of a body, or what lies alone in the beam
  if (all.body.pixels < kLeastShare * all.open.pixels) all.body += all.open;
  return all.body.signal / all.body.pixels;
}

}  // namespace xraycast
