#pragma once

#include "xraycast/fluoroscope/c_arm.hpp"

#include <functional>
#include <vector>

namespace xraycast {

/// A symmetric filter: the weight of a pixel itself, then of both neighbours at one pixel's distance, and so
/// on. The weights add up to 1.
using SymmetricTaps = std::vector<float>;

/// By the frequency in cycles a pixel, up to Nyquist's.
using ByFrequency = std::function<double(double cycles)>;

/// The shortest filter whose transfer function is the asked one within a tolerance above 0 at all
/// frequencies. Throws Error where that takes more than 24 neighbours.
SymmetricTaps taps_for(const ByFrequency& transfer, const ByFrequency& tolerance);

// Quanta are absorbed anywhere in a pixel, their light spreads over a Gaussian from there, and pixels collect
// it over their area. They are counted here by pixels, so that the transfer of Gaussian and aperture is split
// in two: the filter of the counts gives their noise the power that the light of quanta anywhere has, the
// filter before the count gives the picture what is missing. Spreads are in pixels.

/// The transfer of a Gaussian and a pixel's aperture, at all frequencies.
double averaged_gaussian_transfer(double cycles, double spread);

/// The root of its power at all frequencies that the pixels' grid takes for one.
double aliased_gaussian_transfer(double cycles, double spread);

/// The filter of the counts. That of wide Gaussians is sampled to four spreads, others' are fitted.
SymmetricTaps light_taps(double spread, const ByFrequency& tolerance);

ScintillatorBlur in_pixels(const ScintillatorBlur& blur, double pixel_mm);

/// The transfer of the filters of the counts, of a scintillator's spreads in pixels.
double light_transfer(double cycles, const ScintillatorBlur& blur);

/// The filter before the count: the focal spot's, and the rest of the scintillator's and the aperture's.
SymmetricTaps primary_taps(double focal_spread, const ScintillatorBlur& blur, const ByFrequency& tolerance);

/// What pixels see of an opaque edge, by the distance of their middle from it.
class EdgeProfile {
 public:
  /// With sharp pixels.
  EdgeProfile() : EdgeProfile(0, {}, {1}) {}

  /// As `primary_taps` sees it: overshoots a little beside the edge, which the light's filter takes back.
  static EdgeProfile behind_scintillator(double focal_spread, const ScintillatorBlur& blur);

  /// The share of the beam, `inside` pixels within the open side.
  double at(double inside) const;

 private:
  static constexpr int kPerPixel = 64;
  EdgeProfile(double focal_spread, const ScintillatorBlur& blur, const SymmetricTaps& taps);
  double reach_ = 0;
  std::vector<float> shares_;  ///< from -reach to reach
};

}  // namespace xraycast
