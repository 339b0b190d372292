#pragma once

namespace xraycast {

// Mechanics counts in mN, uJ and uN mm inside, and gives N, J and N m.
inline constexpr double kMilli = 1e-3, kMicro = 1e-6;

}  // namespace xraycast
