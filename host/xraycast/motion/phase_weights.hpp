#pragma once

#include <span>
#include <vector>

namespace xraycast {

/// How much the values at ascending phases, two or more from 0 to 1, count at a phase: of a Catmull-Rom
/// spline through them, which is closed where the phases wrap. One a phase; they add up to 1.
std::vector<double> phase_weights(std::span<const double> phases, bool wraps, double phase);

}  // namespace xraycast
