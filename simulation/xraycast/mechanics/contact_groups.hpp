#pragma once

#include <array>
#include <cstddef>

namespace xraycast {

// Contacts are evaluated four at once during a step. What a group of them needs is kept by quantity and not
// by contact, as the processor's vectors take it.

inline constexpr std::size_t kContactGroup = 4;
using GroupNumbers = std::array<double, kContactGroup>;
using GroupVectors = std::array<GroupNumbers, 3>;
using GroupIndices = std::array<std::size_t, kContactGroup>;

}  // namespace xraycast
