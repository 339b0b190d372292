#pragma once

#include <span>
#include <string_view>

namespace xraycast {

/// One file of simulation/instruments/.
struct EmbeddedInstrument {
  std::string_view name;    ///< file name without .json
  std::string_view source;  ///< JSON, see InstrumentModel::from_json
};

/// All presets, in the order of simulation/CMakeLists.txt.
std::span<const EmbeddedInstrument> embedded_instruments();

}  // namespace xraycast
