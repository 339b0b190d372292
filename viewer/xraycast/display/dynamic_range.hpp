#pragma once

#include "xraycast/display/cell_ramps.hpp"

namespace xraycast {

/// Takes back a share of what is large and strong in a picture of logarithms, so that lung, spine and metal
/// fit into one grey window, and leaves what is small, such as instruments, as it is.
///
/// What is large, the base, is a mean over some 2 cm that does not reach over edges, so that nothing rings
/// beside them: of the windows that have a cell on a side or in a corner, the one whose mean is most like it
/// (side windows: H. Yin, Y. Gong and G. Qiu, CVPR 2019), twice. It is found on cells of some millimetres.
/// Pixels take it from lines in their own logarithm, fitted cell by cell (K. He and J. Sun, Fast guided
/// filter, arXiv:1505.00996), so that it has their edges; the lines are fitted again to the base that they
/// give.
class DynamicRange {
 public:
  /// `pixel_mm`: at the isocentre.
  DynamicRange(const PictureSize& size, double pixel_mm);

  /// Finds the base of a picture, one value a pixel.
  void measure(const PixelPlane& logarithm);

  /// Row j, of whose base `strength` (0 to 1) of the difference from `middle` is taken back.
  void compress_row(int j, const float* logarithm, float strength, float middle, float* out) const;

 private:
  void average(const PixelPlane& logarithm);
  void fit_lines();

  PictureSize size_;
  CellRamps ramps_;
  int radius_;                ///< of a window, in cells
  PixelPlane means_, base_;   ///< of the cells
  PixelPlane slope_, start_;  ///< base = slope * logarithm + start
};

}  // namespace xraycast
