#pragma once

#include <span>
#include <string_view>

namespace xraycast {

/// The content of one file of phantom/data/.
struct EmbeddedPhantom {
  std::string_view name;  ///< of the file, without .json
  std::string_view source;
};

/// All of them, in the order of host/CMakeLists.txt.
std::span<const EmbeddedPhantom> embedded_phantoms();

}  // namespace xraycast
