#pragma once

#include "xraycast/display/picture_rows.hpp"

namespace xraycast {

/// Makes edges, wires and catheters stand out: adds a share of what the mean of 3 x 3 pixels has above the
/// mean of some 3 mm about it. So what is enhanced has the size of instruments, and is less noisy than a
/// pixel; of strong edges, as of the lung, no more is added than of a catheter, and half as much on
/// their light side, so that they have no halos.
class EdgeEnhancement {
 public:
  static constexpr float kStrength = 0.8f;  // chosen by eye, as the width: units' settings are not published
  /// Of the logarithm, before the strength: where it makes darker, and lighter, as beside metal.
  static constexpr float kMostDarker = 0.1f, kMostLighter = 0.05f;

  /// `pixel_mm`: at the isocentre.
  EdgeEnhancement(const PictureSize& size, double pixel_mm);

  /// The wider mean reaches so many pixels to all sides.
  int reach() const { return reach_; }

  /// A picture of logarithms goes on beyond its ends as it ends.
  void enhance(const PixelPlane& picture, PixelPlane& enhanced) const;

 private:
  PictureSize size_;
  int reach_;
};

}  // namespace xraycast
