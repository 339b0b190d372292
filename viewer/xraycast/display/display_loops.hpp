#pragma once

#include <cstddef>
#include <cstdint>

// The display's loops over the pixels of a row, for a compiler to vectorise.
namespace xraycast {

/// sums += row
void added_row(const float* row, int count, float* sums);

/// sums += entering - leaving
void moved_row(const float* entering, const float* leaving, int count, float* sums);

/// What EdgeEnhancement adds: a difference, no less than -most_darker and no more than most_lighter, times
/// `strength`; `reach` of the wider mean.
struct Enhancement {
  int reach;
  float strength, most_darker, most_lighter;
};
/// A row with what the mean of 3 x 3 pixels has above that of the wider square about it. `near` and `wide`:
/// sums of columns of 3 and of 2 reach + 1 rows, with `reach` more columns on both sides.
void enhanced_row(const float* row, const float* near, const float* wide, const Enhancement& by, int count,
                  float* out);

/// How StarvedPixels calms a row: where the mean of 5 x 5 codes is less than `below` above `dark`, noise is
/// at most `most_noise` of the mean, which counts as `least_level` at least, and nothing is below
/// `least_share` of it. The noise's variance is that of the electronics, and `per_code` of the mean.
struct Calming {
  float dark, below, electronic, per_code, most_noise, least_share, least_level;
};
/// Sets the logarithms of the codes above dark there. `columns`: sums of columns of 5 codes, with two more on
/// both sides.
void calmed_row(const std::uint16_t* codes, const float* columns, const Calming& by, int count,
                float* logarithm);

/// Sums over 3 x 3 pixels, in thousandths, up to 3600 of them: nine are below 32768. Rows have one pixel more
/// on both sides.
void summed_row(const float* above, const float* row, const float* below, int count, std::int16_t* out);

/// The largest of lines[i] and of the absolute sum along the line through pixel i: nine pixels, each `step`
/// further in memory than the one before it.
void stronger_line_row(const std::int16_t* pixels, std::ptrdiff_t step, int count, std::int16_t* lines);

/// The weight of a new frame: `still` where a line is below `from` times the usual, 1 above `to` times and
/// where something has `moved`.
struct FrameWeight {
  float still, from, to;
};

/// Whether lines are more than so many times the usual ones: 1 or 0.
void above_row(const std::int16_t* lines, const float* usual, float times, int count, std::uint8_t* above);
/// either |= one
void united_row(const std::uint8_t* one, int count, std::uint8_t* either);
/// shown += weight (now - shown)
void recursive_row(const float* now, const std::int16_t* lines, const float* usual, const std::uint8_t* moved,
                   const FrameWeight& weight, int count, float* shown);

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
