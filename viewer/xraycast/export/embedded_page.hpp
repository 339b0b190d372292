#pragma once

#include "xraycast/base/embedded_file.hpp"

#include <span>

namespace xraycast {

/// The built page of web/, without a session in it: one file.
std::span<const EmbeddedFile> embedded_pages();

}  // namespace xraycast
