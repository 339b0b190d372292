#include "xraycast/display/between_blades.hpp"

#include "xraycast/display/display_loops.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

constexpr float kUnshaded = 0.98f;

}  // namespace

BetweenBlades::BetweenBlades(const PictureSize& size)
    : size_(size),
      spans_(static_cast<std::size_t>(size.height)),
      row_like_(static_cast<std::size_t>(size.height)) {}

void BetweenBlades::find_spans(const PixelPlane& field) {
  for_bands(size_, [&](int first, int end) {
    for (int j = first; j < end; ++j) {
      const float* const row = field.data() + size_.row(j);
      Span span{0, size_.width};
      while (span.first < span.end && row[span.first] < kUnshaded) ++span.first;
      while (span.first < span.end && row[span.end - 1] < kUnshaded) --span.end;
      spans_[static_cast<std::size_t>(j)] = span;
    }
  });
  const auto is_open = [](const Span& span) { return span.end > span.first; };
  const auto is_whole = [&](const Span& span) { return span.end - span.first == size_.width; };
  is_whole_ = std::all_of(spans_.begin(), spans_.end(), is_whole);
  is_continued_ = !is_whole_ && std::any_of(spans_.begin(), spans_.end(), is_open);
  if (!is_continued_) return;
  const auto take_from = [&](int j, int other) {
    const auto at = static_cast<std::size_t>(j);
    if (!is_open(spans_[at]) && other >= 0 &&
        (row_like_[at] < 0 || std::abs(other - j) < std::abs(row_like_[at] - j)))
      row_like_[at] = other;
  };
  for (int j = 0; j < size_.height; ++j)
    row_like_[static_cast<std::size_t>(j)] = is_open(spans_[static_cast<std::size_t>(j)]) ? j : -1;
  for (int j = 1; j < size_.height; ++j) take_from(j, row_like_[static_cast<std::size_t>(j) - 1]);
  for (int j = size_.height - 1; j-- > 0;) take_from(j, row_like_[static_cast<std::size_t>(j) + 1]);
}

const PixelPlane& BetweenBlades::continued(const PixelPlane& picture, const PixelPlane& field) {
  find_spans(field);
  if (!is_continued_) return picture;
  continued_.resize(size_.pixels());
  for_bands(size_, [&](int first, int end) {
    for (int j = first; j < end; ++j) {
      const int like = row_like_[static_cast<std::size_t>(j)];
      const Span span = spans_[static_cast<std::size_t>(like)];
      const float* const from = picture.data() + size_.row(like);
      float* const to = continued_.data() + size_.row(j);
      std::fill_n(to, span.first, from[span.first]);
      std::copy(from + span.first, from + span.end, to + span.first);
      std::fill(to + span.end, to + size_.width, from[span.end - 1]);
    }
  });
  return continued_;
}

void BetweenBlades::shade(const PixelPlane& field, PixelPlane& logarithm) const {
  if (is_whole_) return;
  constexpr float kShut = 0.02f, kBlack = -50;  // below any window
  for_bands(size_, [&](int first, int end) {
    for (std::size_t i = size_.row(first); i < size_.row(end); ++i)
      if (field[i] < kShut)
        logarithm[i] = kBlack;
      else if (field[i] < kUnshaded)
        logarithm[i] += std::log(field[i]);
  });
}

}  // namespace xraycast
