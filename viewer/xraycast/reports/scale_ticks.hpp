#pragma once

#include <vector>

namespace xraycast {

/// Round values from `low` to `high`, in rising order: multiples of 1, 2 or 5 times a power of ten that is
/// `least_step` or more. Where fewer than two of these lie within, the outermost two of a finer step; `low`
/// alone where `high` is not above it.
std::vector<double> scale_ticks(double low, double high, double least_step);

}  // namespace xraycast
