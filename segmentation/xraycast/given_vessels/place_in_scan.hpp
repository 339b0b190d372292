#pragma once

#include "xraycast/volume/volume.hpp"

#include <glm/vec3.hpp>

#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// Whether points of vessels lie in a scan's body. Notes, with `name` in front, say so where a part of them
/// lies beyond the scan, where all of them would fit it better turned into the other frame (more of the other
/// place is body, or it is brighter by far), and where they fill only a small part of it in their unit.
/// Throws InputError where half of the points or more lie beyond the scan; it names the unit or frame that
/// would put them inside.
std::vector<std::string> check_place(std::span<const glm::vec3> points_mm, const Volume& scan,
                                     const std::string& name);

}  // namespace xraycast
