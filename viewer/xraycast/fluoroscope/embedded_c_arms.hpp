#pragma once

#include <span>
#include <string_view>

namespace xraycast {

/// One file of viewer/c_arms/.
struct EmbeddedC_arm {
  std::string_view name;    ///< file name without .json
  std::string_view source;  ///< JSON, see CArm::from_json
};

/// All presets, in the order of viewer/CMakeLists.txt.
std::span<const EmbeddedC_arm> embedded_c_arms();

}  // namespace xraycast
