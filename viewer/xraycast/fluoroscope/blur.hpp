#pragma once

#include <functional>
#include <vector>

namespace xraycast {

/// A symmetric filter: the weight of a pixel itself, then of both neighbours at one pixel's distance, and so
/// on. The weights add up to 1.
using SymmetricTaps = std::vector<float>;

/// The shortest filter whose transfer function is the asked one within 0.006 at all frequencies up to
/// Nyquist's, in cycles a pixel; where that takes more than 24 neighbours, those.
SymmetricTaps taps_for(const std::function<double(double cycles)>& transfer);

double transfer_of(const SymmetricTaps& taps, double cycles);

}  // namespace xraycast
