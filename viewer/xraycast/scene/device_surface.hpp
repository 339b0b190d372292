#pragma once

#include "xraycast/scene/device_tubes.hpp"
#include "xraycast/scene/scene.hpp"

#include <glm/vec3.hpp>

#include <vector>

namespace xraycast {

/// How a matter is drawn.
struct DeviceMaterial {
  double mu_per_mm;
  glm::dvec3 colour;
  int tube_sides;
};

/// A balloon is filled with contrast agent that is diluted by half.
const DeviceMaterial& material_of(DeviceMatter matter);

Surface device_surface(const DeviceTube& tube);
std::vector<Surface> device_surfaces(const std::vector<DeviceTube>& tubes);

}  // namespace xraycast
