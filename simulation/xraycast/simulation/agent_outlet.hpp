#pragma once

#include "xraycast/coaxial/instruments.hpp"

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// The instrument at whose tip contrast agent leaves that is injected through the outermost free lumen; none
/// where no lumen is free. An instrument whose tip lies in another one's lumen fills that, and the agent
/// leaves at the other one's tip.
std::optional<std::size_t> agent_outlet(const Instruments& instruments);

/// Why no agent can be injected where agent_outlet is none, and what to do, for the end of a sentence.
std::string reason_for_no_outlet(const std::vector<InstrumentModel>& models);

}  // namespace xraycast
