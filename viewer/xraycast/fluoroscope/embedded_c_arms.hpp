#pragma once

#include "xraycast/base/embedded_file.hpp"

#include <span>

namespace xraycast {

/// The files of viewer/c_arms/, which CArm::from_json reads, in the order of viewer/CMakeLists.txt.
std::span<const EmbeddedFile> embedded_carms();

}  // namespace xraycast
