#pragma once

#include "xraycast/coaxial/instruments.hpp"

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// The device at whose tip contrast agent leaves that is injected through the outermost free lumen; none
/// where no lumen is free. A device whose tip lies in another one's lumen fills that, and the agent leaves
/// at the other one's tip.
std::optional<std::size_t> agent_outlet(const Instruments& devices);

/// Why no agent can be injected where agent_outlet is none, and what to do, for the end of a sentence.
std::string reason_for_no_outlet(const std::vector<InstrumentModel>& models);

}  // namespace xraycast
