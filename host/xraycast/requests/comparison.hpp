#pragma once

#include <cstdint>
#include <span>

namespace xraycast {

/// The similarity of a picture's optical depths to those of the DRR.
struct ImageSimilarity {
  double psnr_db;  ///< of the transmissions exp(-tau), peak 1
  double ssim;     ///< of the displayed picture, 1 - exp(-tau / 2.2)
  double rmse;     ///< of the optical depths, relative to the DRR's maximum
  double deepest;  ///< that maximum
};

/// Compares two pictures (height x width) over the pixels where `counts` is not 0. Transmission is
/// insensitive where the body is thick, hence the error of the optical depths as well.
///
/// SSIM is that of Z. Wang et al., Image quality assessment: from error visibility to structural similarity,
/// IEEE Trans. Image Process. 13, 2004, 600-612: windows of 11 x 11 pixels, weighted by a Gaussian of 1.5
/// pixels, K1 = 0.01, K2 = 0.03, averaged over the windows whose middle counts.
ImageSimilarity compare(std::span<const float> tau, std::span<const float> drr,
                        std::span<const std::uint8_t> counts, int width, int height);

}  // namespace xraycast
