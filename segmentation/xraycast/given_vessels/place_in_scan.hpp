#pragma once

#include "xraycast/volume/volume.hpp"

#include <glm/vec3.hpp>

#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// A note where a part of the points lies beyond a scan. Throws InputError, with `name` in front, where half
/// of them or more do; it says so if they lie within it in another unit or frame.
std::vector<std::string> check_place(std::span<const glm::vec3> points_mm, const VolumeGeometry& scan,
                                     const std::string& name);

}  // namespace xraycast
