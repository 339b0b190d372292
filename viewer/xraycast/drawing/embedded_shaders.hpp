#pragma once

#include "xraycast/base/embedded_file.hpp"

#include <span>

namespace xraycast {

/// The files of viewer/shaders/ in the order of viewer/CMakeLists.txt, each whole, with its includes
/// resolved. Their names keep the extension, which is the shader's stage.
std::span<const EmbeddedFile> embedded_shaders();

}  // namespace xraycast
