#pragma once

#include "xraycast/mask/mask.hpp"

#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// The component of a mask that lies nearest to a point; without one, the largest. A note, with `name` in
/// front, says what is left out.
Mask one_component(const Mask& mask, const std::optional<glm::dvec3>& at_mm, const std::string& name,
                   std::vector<std::string>& notes);

}  // namespace xraycast
