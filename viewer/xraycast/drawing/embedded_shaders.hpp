#pragma once

#include <span>
#include <string_view>

namespace xraycast {

/// One file of viewer/shaders/, whole, with its includes resolved.
struct EmbeddedShader {
  std::string_view name;  ///< file name
  std::string_view source;
};

/// All shader files, in the order of viewer/CMakeLists.txt.
std::span<const EmbeddedShader> embedded_shaders();

}  // namespace xraycast
