#include "xraycast/drawing/brightness.hpp"

#include <algorithm>

namespace xraycast {

GreyWindow automatic_window(Renderer& renderer, const View& view, const Style& style) {
  constexpr int kEnough = 160;  // pixels a side, a thousandth of which are still twenty
  const int every = std::max(1, std::max(view.width, view.height) / kEnough);
  View coarse = view;
  coarse.width = std::max(1, view.width / every);
  coarse.height = std::max(1, view.height / every);
  coarse.pixel_mm = view.pixel_mm * every;
  return automatic_window(renderer.tau(coarse, style), style.window.gamma, style.window.inverted);
}

}  // namespace xraycast
