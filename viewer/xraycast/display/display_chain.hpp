#pragma once

#include "xraycast/display/between_blades.hpp"
#include "xraycast/display/display_window.hpp"
#include "xraycast/display/dynamic_range.hpp"
#include "xraycast/display/edge_enhancement.hpp"
#include "xraycast/display/starved_pixels.hpp"
#include "xraycast/display/temporal_filter.hpp"

#include <cstdint>
#include <optional>
#include <vector>

namespace xraycast {

/// From the detector's codes to the greys on the display: logarithm, starved pixels, compression of the
/// range, edge enhancement, temporal filter, window. The window fits what the body shows; without compression
/// it has a fixed width and follows the level of the measuring field.
class DisplayChain {
 public:
  /// `pixel_mm`: at the isocentre. `compression`: 0 to 1.
  DisplayChain(const PictureSize& size, double pixel_mm, double compression);

  /// The next frame is filtered with none before.
  void forget();

  /// Makes the table of logarithms unless it is there.
  void set_codes(int bits, const CodeNoise& noise);
  void take_logarithm(const std::uint16_t* codes, int count, float* logarithm) const;

  /// Natural logarithms of what a frame is shown by.
  struct Levels {
    double measured;  ///< the measuring field's
    double open;      ///< the open field's, as far as codes reach
  };

  /// What a frame is shown of.
  struct Detected {
    const PixelPlane& logarithm;
    const PixelPlane& left;   ///< by the body of the beam, without scatter and noise
    const PixelPlane& field;  ///< the share of the beam that reaches each pixel
    const std::vector<std::uint16_t>* codes = nullptr;  ///< none: no pixel is starved
  };

  /// One frame. Recorded frames are not filtered over time.
  void show(const Detected& detected, const Levels& levels, bool is_recording, bool is_processed,
            std::uint8_t* grey);

 private:
  /// The range of pictures of one size.
  struct Compression {
    Compression(const PictureSize& size, double pixel_mm, double share);
    void compress(const PixelPlane& logarithm, const PixelPlane& left, const PixelPlane& field,
                  const Levels& levels);

    PictureSize size;
    float strength;
    DynamicRange range;
    DisplayWindow window;
    PixelPlane picture;  ///< the last frame, compressed
  };

  PictureSize size_;
  int bits_ = 0;
  CodeNoise noise_;
  std::vector<float> logarithms_;  ///< of every code
  StarvedPixels starved_;
  BetweenBlades between_blades_;
  std::optional<Compression> compression_;
  EdgeEnhancement edges_;
  PixelPlane enhanced_;
  TemporalFilter filter_;
};

}  // namespace xraycast
