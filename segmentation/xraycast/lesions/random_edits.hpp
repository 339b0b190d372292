#pragma once

#include "xraycast/lesions/edits.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace xraycast {

/// Edits with lesions that a seed draws (EditRequest), each of which fits the tree and those before it. Where
/// one finds no room it is left out, and a note says so. The same on every machine.
Edits with_random_edits(const VesselTree& tree, const Edits& edits, int count, std::uint64_t seed,
                        std::vector<std::string>& notes);

}  // namespace xraycast
