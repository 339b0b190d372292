#include "xraycast/fluoroscope/scintillator_blur.hpp"

#include <cmath>
#include <numbers>

namespace xraycast {

double gaussian_transfer(double frequency, double spread) {
  return std::exp(-2 * std::pow(std::numbers::pi * spread * frequency, 2));
}

double ScintillatorBlur::mtf(double per_mm) const {
  return (1 - wide_share) * gaussian_transfer(per_mm, narrow_mm) +
         wide_share * gaussian_transfer(per_mm, wide_mm);
}

}  // namespace xraycast
