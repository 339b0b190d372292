#include "xraycast/display/display_loops.hpp"

#include "xraycast/base/wide_vectors.hpp"

namespace xraycast {

XRAYCAST_WIDE_VECTORS
void sharpened_row(const float* __restrict above, const float* __restrict row, const float* __restrict below,
                   float strength, int count, float* __restrict out) {
  const float own = 1 + strength, around = strength / 9;
  for (int i = 0; i < count; ++i) {
    const float sum = above[i] + above[i + 1] + above[i + 2] + row[i] + row[i + 1] + row[i + 2] + below[i] +
                      below[i + 1] + below[i + 2];
    out[i] = own * row[i + 1] - around * sum;
  }
}

XRAYCAST_WIDE_VECTORS
void recursive_row(const float* __restrict now, float weight, int count, float* __restrict shown) {
  for (int i = 0; i < count; ++i) shown[i] += weight * (now[i] - shown[i]);
}

XRAYCAST_WIDE_VECTORS
void windowed_row(const float* __restrict logarithm, float per_log, float middle, int count,
                  std::uint8_t* __restrict grey) {
  for (int i = 0; i < count; ++i) {
    const float value = logarithm[i] * per_log + middle;
    grey[i] = static_cast<std::uint8_t>(static_cast<int>(value > 0 ? (value < 255 ? value : 255) : 0));
  }
}

XRAYCAST_WIDE_VECTORS
void compressed_row(const float* __restrict logarithm, const float* __restrict slope,
                    const float* __restrict start, float offset, int count, float* __restrict out) {
  for (int i = 0; i < count; ++i) out[i] = logarithm[i] - slope[i] * logarithm[i] - start[i] + offset;
}

}  // namespace xraycast
