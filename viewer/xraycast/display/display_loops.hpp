#pragma once

#include <cstdint>

// The display's loops over the pixels of a row, for a compiler to vectorise.
namespace xraycast {

/// The middle row sharpened by what it has above the mean of its 3 x 3 neighbourhood. Rows have one pixel
/// more on both sides.
void sharpened_row(const float* above, const float* row, const float* below, float strength, int count,
                   float* out);

/// shown += weight (now - shown)
void recursive_row(const float* now, float weight, int count, float* shown);
void windowed_row(const float* logarithm, float per_log, float middle, int count, std::uint8_t* grey);

/// out = logarithm - (slope * logarithm + start) + offset
void compressed_row(const float* logarithm, const float* slope, const float* start, float offset, int count,
                    float* out);

}  // namespace xraycast
