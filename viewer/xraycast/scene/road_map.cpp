#include "xraycast/scene/road_map.hpp"

#include <algorithm>

namespace xraycast {

std::vector<glm::ivec2> outline_of(std::span<const float> tau, int width, int height) {
  const auto absorbs = [&](int x, int y) {
    const bool is_there = x >= 0 && y >= 0 && x < width && y < height;
    return is_there &&
           tau[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)] >
               0;
  };
  std::vector<glm::ivec2> outline;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      if (absorbs(x, y) &&
          !(absorbs(x - 1, y) && absorbs(x + 1, y) && absorbs(x, y - 1) && absorbs(x, y + 1)))
        outline.emplace_back(x, y);
  return outline;
}

RoadMap::RoadMap(const VesselTree& tree) {
  constexpr int kSides = 12;  // an outline is off by 3 % of a vessel's radius at most
  const Surface lumen{tube_mesh(tree, kSides)};
  lumen_.set(std::span(&lumen, 1));
}

std::span<const glm::ivec2> RoadMap::outline(const View& view) {
  if (view_ == view) return outline_;
  const ScreenBox box = lumen_.box(view);
  outline_ = outline_of(lumen_.tau(view, box), box.width, box.height);
  for (glm::ivec2& pixel : outline_) pixel = {box.x + pixel.x, view.height - 1 - (box.y + pixel.y)};
  view_ = view;
  return outline_;
}

void draw_outline(std::span<const glm::ivec2> outline, glm::u8vec3 colour, int width,
                  std::span<std::uint8_t> rgb) {
  for (const glm::ivec2& pixel : outline) {
    const std::size_t at = 3 * (static_cast<std::size_t>(pixel.y) * static_cast<std::size_t>(width) +
                                static_cast<std::size_t>(pixel.x));
    rgb[at] = colour.x;
    rgb[at + 1] = colour.y;
    rgb[at + 2] = colour.z;
  }
}

}  // namespace xraycast
