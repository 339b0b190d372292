#pragma once

#include <cstdint>
#include <span>

namespace xraycast {

/// How close a picture's optical depths are to the true ones.
struct Likeness {
  double psnr_db;  ///< of the transmissions exp(-tau), peak 1
  double ssim;     ///< of what is displayed, 1 - exp(-tau / 2.2)
  double rmse;     ///< of the optical depths, as a share of their true maximum
};

/// Compares two pictures (height x width) over the pixels where `counts` is not 0. Transmission is blind
/// where the body is thick, hence the error of the optical depths beside it.
///
/// SSIM is that of Z. Wang et al., Image quality assessment: from error visibility to structural similarity,
/// IEEE Trans. Image Process. 13, 2004, 600-612: windows of 11 x 11 pixels, weighted by a Gaussian of 1.5
/// pixels, K1 = 0.01, K2 = 0.03, its mean over the windows that count in the middle.
Likeness compare(std::span<const float> tau, std::span<const float> truth,
                 std::span<const std::uint8_t> counts, int width, int height);

}  // namespace xraycast
