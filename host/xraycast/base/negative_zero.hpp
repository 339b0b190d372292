#pragma once

#include <cmath>

namespace xraycast {

/// The value, or 0 where it would be printed as -0.00 with so many decimals.
inline double no_negative_zero(double value, int decimals) {
  return std::abs(value) <= 0.5 * std::pow(10.0, -decimals) ? 0 : value;
}

}  // namespace xraycast
