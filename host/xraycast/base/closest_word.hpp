#pragma once

#include <string>
#include <vector>

namespace xraycast {

/// The one of `known` that a misspelled word may have been meant for, the first of those with the fewest
/// letters (at most a third of its own) inserted, left out or replaced; or nothing.
std::string closest_word(const std::vector<std::string>& known, const std::string& word);

}  // namespace xraycast
