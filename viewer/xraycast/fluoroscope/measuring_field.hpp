#pragma once

#include "xraycast/display/picture_rows.hpp"

namespace xraycast {

/// The pixels whose mean signal the exposure control follows, in every n-th row: those of the middle half of
/// both sides of the picture, or of the detector where that is smaller, that are in the open field, or where
/// there is none all, by their share of the field. Pixels that the beam reaches with no body before them
/// count only where the field has no others: they would blacken the body beside them.
class MeasuringField {
 public:
  /// `field`: the share of the beam that reaches each pixel. `detector`: its size in the picture's pixels.
  /// Throws InputError where the beam reaches no pixel.
  MeasuringField(const PixelPlane& field, const PictureSize& size, const PictureSize& detector);

  /// Adds a row of the signal to its band's sums; bands on any threads. `left` is the share of the beam
  /// behind the body.
  void measure_row(int j, const float* signal, const float* left, const float* field);

  /// The mean signal of what was measured since the last call.
  double take_mean();

 private:
  bool has_row(int j) const { return j >= first_row_ && j < end_row_ && (j - first_row_) % every_ == 0; }
  float weight(float field) const { return is_weighted_ ? field : field > 0.5f ? 1.0f : 0.0f; }
  double pixels_in(const PixelPlane& field, const PictureSize& size) const;

  int first_row_ = 0, end_row_ = 0, first_column_ = 0, end_column_ = 0, every_;
  bool is_weighted_ = false;
  struct Sum {
    double signal = 0, pixels = 0;
    void operator+=(const Sum& other);
  };
  struct Sums {
    Sum body, open;
  };
  std::vector<Sums> bands_;
};

}  // namespace xraycast
