#include "xraycast/simulation/injection.hpp"

#include <algorithm>

namespace xraycast {

double Injection::mean_rate_ml_s(double begin_s, double end_s) const {
  const double injecting_s = std::min(to_s, end_s) - std::max(from_s, begin_s);
  return rate_ml_s * std::max(0.0, injecting_s) / (end_s - begin_s);
}

}  // namespace xraycast
