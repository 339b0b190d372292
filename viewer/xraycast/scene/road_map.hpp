#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/scene/absorbing_surfaces.hpp"

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace xraycast {

/// The outline of vessels in a picture of their optical depth alone (height x width, row 0 on top):
/// attenuating pixels with a 4-neighbour that does not attenuate.
std::vector<glm::ivec2> outline_of(std::span<const float> tau, int width, int height);

/// A vessel tree's outline in a view, over which a catheter is steered.
class RoadMap {
 public:
  explicit RoadMap(const VesselTree& tree);

  /// In the view's pixels, row 0 on top; recomputed when the view changes.
  std::span<const glm::ivec2> outline(const View& view);

 private:
  AbsorbingSurfaces lumen_;
  std::optional<View> view_;
  std::vector<glm::ivec2> outline_;
};

inline constexpr glm::u8vec3 kRoadMapColour{190, 150, 60};

/// Draws pixels into an 8-bit RGB picture of `width`.
void draw_outline(std::span<const glm::ivec2> outline, glm::u8vec3 colour, int width,
                  std::span<std::uint8_t> rgb);

}  // namespace xraycast
