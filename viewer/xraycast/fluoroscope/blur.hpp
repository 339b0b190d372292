#pragma once

#include <functional>
#include <vector>

namespace xraycast {

/// A symmetric filter: the weight of a pixel itself, then of both neighbours at one pixel's distance, and so
/// on. The weights add up to 1.
using SymmetricTaps = std::vector<float>;

/// By the frequency in cycles a pixel, up to Nyquist's.
using ByFrequency = std::function<double(double cycles)>;

/// The shortest filter whose transfer function is the asked one within a tolerance above 0 at all
/// frequencies; where that takes more than 24 neighbours, those.
SymmetricTaps taps_for(const ByFrequency& transfer, const ByFrequency& tolerance);

/// A point's Gaussian of that spread in pixels, or what pixels see of it, which average over their area.
/// Wide ones are sampled to four spreads, narrow ones, whose samples alias, fitted.
SymmetricTaps gaussian_taps(double spread, const ByFrequency& tolerance);
SymmetricTaps averaged_gaussian_taps(double spread, const ByFrequency& tolerance);

double transfer_of(const SymmetricTaps& taps, double cycles);

}  // namespace xraycast
