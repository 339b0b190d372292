#pragma once

#include <cstdint>
#include <string>

namespace xraycast {

/// `1 layer`, `8 layers`, `2 branches`, `3 studies`.
std::string pluralize(std::int64_t count, const std::string& noun);

}  // namespace xraycast
