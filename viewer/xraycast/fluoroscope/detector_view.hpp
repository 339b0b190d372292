#pragma once

#include "xraycast/fluoroscope/fluoroscopy_options.hpp"
#include "xraycast/fluoroscope/measuring_field.hpp"
#include "xraycast/projection/view.hpp"

namespace xraycast {

/// What depends on the view: the picture on the detector, and the beam that reaches it.
struct DetectorView {
  /// Throws InputError for blades that leave no pixel open.
  DetectorView(const FluoroscopyOptions& options, const View& view);

  PictureSize size;
  double pixel_mm;
  PixelPlane field;  ///< the share of the beam that reaches each pixel between the blades
  // Of the whole beam on the detector, whatever part of it the picture shows.
  double open_area_cm2 = 0;
  double beam_width_mm = 0, beam_height_mm = 0;  ///< through its middle
  MeasuringField measured;
};

}  // namespace xraycast
