#include "xraycast/drawing/still_picture.hpp"

#include "xraycast/base/picture_file.hpp"
#include "xraycast/drawing/brightness.hpp"
#include "xraycast/drawing/headless_context.hpp"

namespace xraycast {

std::string still_png(Renderer& renderer, const ExportRequest& request) {
  constexpr int kWidth = 480, kHeight = 360;
  std::vector<Surface> surfaces;
  if (request.vessels && request.shows_vessels) surfaces.push_back(*request.vessels);
  surfaces.insert(surfaces.end(), request.catheters.begin(), request.catheters.end());
  renderer.set_map(request.map);
  if (moves(request)) renderer.set_phases(first_phases(request));
  renderer.set_surfaces(surfaces);
  const View view = view_of(request.pose, bounds_of(request.map->geometry), kWidth, kHeight);
  Style style = request.style;
  style.sampling = {};
  if (!request.has_window) style.window = automatic_window(renderer, view, style);
  return png_bytes(renderer.picture(view, style), kWidth, kHeight, 3);
}

std::string still_png(const ExportRequest& request) {
  const HeadlessContext context;
  Renderer renderer;
  return still_png(renderer, request);
}

}  // namespace xraycast
