#pragma once

#include "xraycast/base/embedded_file.hpp"

#include <span>

namespace xraycast {

/// What web/ builds: page.html, without a session in it, and simulation.txt, the simulation as WebAssembly,
/// deflated, in base64.
std::span<const EmbeddedFile> embedded_pages();

}  // namespace xraycast
