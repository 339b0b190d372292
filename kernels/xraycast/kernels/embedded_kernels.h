#pragma once

#include <span>
#include <string_view>

namespace xraycast {

/// One file of kernels/, whole, with its includes resolved: as EmbeddedFile, which lies above this room.
struct EmbeddedKernel {
  std::string_view name;  ///< file name without `.cl`
  std::string_view source;
};

/// All kernel files, in the order of kernels/CMakeLists.txt.
std::span<const EmbeddedKernel> embedded_kernels();

}  // namespace xraycast
