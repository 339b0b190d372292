#pragma once

#include <cstdint>
#include <functional>

namespace xraycast {

/// Calls `work(i)` once for every i in [0, count), on all cores, or on XRAYCAST_THREADS of them, in no
/// particular order, and returns when all calls have. The first exception ends the loop early and is thrown
/// here.
void parallel_for(std::int64_t count, const std::function<void(std::int64_t)>& work);

}  // namespace xraycast
