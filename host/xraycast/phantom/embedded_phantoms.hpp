#pragma once

#include "xraycast/base/embedded_file.hpp"

#include <span>

namespace xraycast {

/// The files of phantom/data/, in the order of host/CMakeLists.txt.
std::span<const EmbeddedFile> embedded_phantoms();

}  // namespace xraycast
