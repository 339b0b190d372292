#pragma once

#include <span>
#include <string_view>

namespace xraycast {

/// One file of viewer/c_arms/.
struct EmbeddedCarm {
  std::string_view name;    ///< file name without .json
  std::string_view source;  ///< JSON, see CArm::from_json
};

/// All presets, in the order of viewer/CMakeLists.txt.
std::span<const EmbeddedCarm> embedded_carms();

}  // namespace xraycast
