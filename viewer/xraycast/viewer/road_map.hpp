#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <cstdint>
#include <span>
#include <vector>

namespace xraycast {

/// The outline of vessels in a picture of their optical depth alone (height x width, row 0 on top): pixels
/// that absorb beside ones that do not.
std::vector<glm::ivec2> outline_of(std::span<const float> tau, int width, int height);

inline constexpr glm::u8vec3 kRoadMapColour{190, 150, 60};

/// Draws pixels into an 8-bit RGB picture of `width`.
void draw_outline(std::span<const glm::ivec2> outline, glm::u8vec3 colour, int width,
                  std::span<std::uint8_t> rgb);

}  // namespace xraycast
