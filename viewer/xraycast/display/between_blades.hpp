#pragma once

#include "xraycast/display/picture_rows.hpp"

#include <vector>

namespace xraycast {

/// A picture as it would go on beyond the blades: every pixel that they shade is as the nearest one of its
/// row that is open, or as in the nearest row that has one. What looks about a pixel, as edge enhancement,
/// sees no blades then, and leaves no frame beside them.
class BetweenBlades {
 public:
  explicit BetweenBlades(const PictureSize& size);

  /// The same picture where nothing is shaded, or everything; else valid until the next call. `field`: the
  /// share of the beam that reaches each pixel.
  const PixelPlane& continued(const PixelPlane& picture, const PixelPlane& field);

  /// Darkens what the blades shade, in a picture of logarithms, and blanks what they shut off.
  void shade(const PixelPlane& field, PixelPlane& logarithm) const;

 private:
  /// Open pixels of a row: none where `end` is `first`.
  struct Span {
    int first = 0, end = 0;
  };
  void find_spans(const PixelPlane& field);

  PictureSize size_;
  std::vector<Span> spans_;
  std::vector<int> row_like_;                    ///< for each row the nearest one with open pixels
  bool is_whole_ = true, is_continued_ = false;  ///< nothing is shaded; something is, and not all
  PixelPlane continued_;
};

}  // namespace xraycast
