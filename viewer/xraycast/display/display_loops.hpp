#pragma once

#include <cstddef>
#include <cstdint>

// The display's loops over the pixels of a row, for a compiler to vectorise.
namespace xraycast {

/// sums += row
void added_row(const float* row, int count, float* sums);

/// What EdgeEnhancement adds: up to `most` of a difference, times `strength`; `reach` of the wider mean.
struct Enhancement {
  int reach;
  float strength, most;
};
/// A row with what the mean of 3 x 3 pixels has above that of the wider square about it. `near` and `wide`:
/// sums of columns of 3 and of 2 reach + 1 rows, with `reach` more columns on both sides.
void enhanced_row(const float* row, const float* near, const float* wide, const Enhancement& by, int count,
                  float* out);

/// Sums over 3 x 3 pixels. Rows have one pixel more on both sides.
void summed_row(const float* above, const float* row, const float* below, int count, float* out);

/// A line reaches so many pixels to both sides of its middle.
inline constexpr int kLineReach = 8;

/// Of the lines through each pixel in eight directions, every second pixel of each, the largest absolute sum.
/// `stride`: pixels of a row; around the pixels there are kLineReach more on all sides.
void strongest_lines_row(const float* pixels, std::ptrdiff_t stride, int count, float* out);

/// The weight of a new frame: `still` where a line is below `from` times the usual, 1 above `to` times.
struct FrameWeight {
  float still, from, to;
};

/// Whether lines are more than so many times the usual ones: 1 or 0.
void above_row(const float* lines, const float* usual, float times, int count, std::uint8_t* above);
/// either |= one
void united_row(const std::uint8_t* one, int count, std::uint8_t* either);
/// Lines as strong as so many times the usual ones, where `moved` is not 0.
void strengthened_row(const std::uint8_t* moved, const float* usual, float times, int count, float* lines);

/// shown += weight (now - shown)
void recursive_row(const float* now, const float* lines, const float* usual, const FrameWeight& weight,
                   int count, float* shown);
void windowed_row(const float* logarithm, float per_log, float middle, int count, std::uint8_t* grey);

/// A grey of 0 to 255 by a logarithm.
struct GreyLine {
  float per_log, at_zero;
};
/// The larger of two.
void windowed_row(const float* logarithm, const GreyLine& a, const GreyLine& b, int count,
                  std::uint8_t* grey);

/// out = logarithm - (slope * logarithm + start) + offset
void compressed_row(const float* logarithm, const float* slope, const float* start, float offset, int count,
                    float* out);

}  // namespace xraycast
