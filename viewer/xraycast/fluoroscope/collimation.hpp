#pragma once

#include "xraycast/projection/view.hpp"

#include <vector>

namespace xraycast {

class EdgeProfile;

/// The opening between the blades, measured on the detector, about the picture's middle.
struct Collimation {
  double width_mm = 0, height_mm = 0;
  double turn_rad = 0;  ///< anticlockwise in the picture
};

/// The opening's area where it lies within an upright field and, with `round_mm` above 0, within a circle of
/// that diameter.
double open_area_mm2(const Collimation& blades, double width_mm, double height_mm, double round_mm);

/// Shares of the beam that reach the pixels: 1 in the open field, 0 behind the opaque blades, and between
/// them what pixels see of an edge. `round_mm` above 0: the image field is a circle of that diameter. H x W,
/// row 0 on top.
std::vector<float> open_field(const View& view, const Collimation& collimation, double round_mm,
                              const EdgeProfile& edge);

}  // namespace xraycast
