#pragma once

#include "xraycast/display/picture_rows.hpp"
#include "xraycast/fluoroscope/blur.hpp"
#include "xraycast/fluoroscope/c_arm.hpp"

namespace xraycast {

/// A filter of a picture: along its rows in one pass, down its columns in the next. Beyond the picture it
/// continues as its edge.
class SeparableFilter {
 public:
  explicit SeparableFilter(const PictureSize& size, SymmetricTaps taps = {1});

  /// Filters a row for the second pass; rows in any order, on any threads.
  void pass_along(int j, const float* row);

  /// After all rows: `weight` times row j of the filtered picture is in `out`, or is added to it.
  void pass_down(int j, float weight, float* out) const;
  void add_down(int j, float weight, float* out) const;

 private:
  const float* const* rows_about(int j) const;
  PictureSize size_;
  SymmetricTaps taps_;
  PixelPlane along_rows_;
};

/// Focal spot, which blurs the picture before its quanta are counted, and scintillator and pixel aperture, of
/// which a part does, and the other part blurs these.
class BlurStage {
 public:
  /// Without blur.
  explicit BlurStage(const PictureSize& size);
  /// Throws InputError for pixels that are too fine for it.
  BlurStage(const PictureSize& size, double pixel_mm, const CArm& c_arm);

  SeparableFilter primary;

  void scintillate_along(int j, const float* energy_kev);
  /// Row j of the absorbed energy.
  void scintillate_down(int j, float* signal_kev) const;

 private:
  PictureSize size_;
  SeparableFilter narrow_, wide_;
  float wide_share_ = 0;
};

/// What goes with `primary`. Throws as the stage.
EdgeProfile edge_behind_scintillator(const CArm& c_arm, double pixel_mm);

}  // namespace xraycast
