#pragma once

#include "xraycast/drawing/renderer.hpp"

namespace xraycast {

/// The grey window for what a view shows, as a C-arm's automatic brightness control sets it by what reaches
/// the detector: from the optical depths of the picture, of which every few pixels are drawn. Gamma and
/// inversion stay the style's.
GreyWindow automatic_window(Renderer& renderer, const View& view, const Style& style);

}  // namespace xraycast
