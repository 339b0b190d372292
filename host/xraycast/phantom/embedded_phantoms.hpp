#pragma once

#include <span>
#include <string_view>

namespace xraycast {

/// One file of phantom/data/, whole.
struct EmbeddedPhantom {
  std::string_view name;  ///< of the file, without .json
  std::string_view source;
};

/// All of them, in the order of host/CMakeLists.txt.
std::span<const EmbeddedPhantom> embedded_phantoms();

}  // namespace xraycast
