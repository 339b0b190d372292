#pragma once

#include "xraycast/base/embedded_file.hpp"

#include <span>

namespace xraycast {

/// The files of simulation/instruments/, which InstrumentModel::from_json reads, in the order of
/// simulation/CMakeLists.txt.
std::span<const EmbeddedFile> embedded_instruments();

}  // namespace xraycast
