#pragma once

#include <cstdint>
#include <span>
#include <vector>

// How alike two pictures are, whatever their brightness and contrast.
namespace xraycast::similarity {

/// Two pictures of one size, height x width, row 0 on top.
struct Pair {
  int width = 0, height = 0;
  std::span<const float> fixed, moving;
  std::span<const std::uint8_t> mask{};  ///< pixels that count, not 0; empty: all
};

// The following return 0 where a picture has no contrast. With `slope` they also give the derivatives by
// every pixel of the moving picture, one for one. Throw InputError when sizes differ.

/// Normalised cross-correlation, -1 to 1.
double ncc(const Pair& pair, std::vector<float>* slope = nullptr);

/// The mean of the normalised cross-correlations of the pictures' derivatives along rows and columns
/// (Penney et al., IEEE Trans. Med. Imaging 17, 1998), each smoothed over about a pixel; -1 to 1. Pixels
/// count whose neighbourhood of 7 x 7 lies within the picture and the mask.
double gradient_ncc(const Pair& pair, std::vector<float>* slope = nullptr);

/// Mutual information in nats, from a joint histogram of 32 x 32 greys between the pictures' extremes, into
/// which the moving picture's are spread by cubic B-splines and the fixed one's fall as they are (Mattes et
/// al., IEEE Trans. Med. Imaging 22, 2003).
double mutual_information(const Pair& pair, std::vector<float>* slope = nullptr);

}  // namespace xraycast::similarity
