#pragma once

#include "xraycast/base/embedded_file.hpp"

#include <span>

namespace xraycast {

/// The scripts of examples/steering/ that the demo runs, for Script.
std::span<const EmbeddedFile> embedded_scripts();

}  // namespace xraycast
