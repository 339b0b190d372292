#pragma once

#include "xraycast/drawing/renderer.hpp"

namespace xraycast {

/// The grey window for a view's picture, chosen from its optical depths as a C-arm's automatic brightness
/// control does from the dose at the detector. The picture is drawn at a lower resolution for that. Gamma and
/// inversion stay the style's.
GreyWindow automatic_window(Renderer& renderer, const View& view, const Style& style);

}  // namespace xraycast
