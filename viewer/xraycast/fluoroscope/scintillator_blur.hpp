#pragma once

namespace xraycast {

/// The transfer of a Gaussian of that spread, exp(-2 pi^2 s^2 f^2), in frequencies a unit of the spread.
double gaussian_transfer(double frequency, double spread);

/// The MTF of a scintillator, or of an intensifier with its camera: the sum of two Gaussians, of the spreads
/// n and w and the shares 1 - s and s. The pixel is not in it.
struct ScintillatorBlur {
  double narrow_mm = 0, wide_mm = 0, wide_share = 0;
  double mtf(double per_mm) const;
};

}  // namespace xraycast
