#pragma once

#include <string>
#include <string_view>

namespace xraycast {

/// Bytes as a stream of zlib (RFC 1950), of a level from 1, the fastest, to 9, the smallest. Throws
/// std::bad_alloc when memory runs out.
std::string deflated(std::string_view bytes, int level);

}  // namespace xraycast
