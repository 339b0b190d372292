#include "xraycast/contrast_agent/injection.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

void check_amount(const char* field, double value, double most, const char* unit) {
  if (!(value > 0 && value <= most))
    throw InputError("`{}` {:g}: must be above 0 and at most {:g} {}", field, value, most, unit);
}

}  // namespace

void Injection::end_after(double volume_ml) {
  check_amount("injection_volume_ml", volume_ml, kMaxInjection_ml, "ml");
  to_s = std::min(to_s, from_s + volume_ml / rate_ml_s);
}

double Injection::mean_rate_ml_s(double begin_s, double end_s) const {
  const double injecting_s = std::min(to_s, end_s) - std::max(from_s, begin_s);
  return rate_ml_s * std::max(0.0, injecting_s) / (end_s - begin_s);
}

void check(const Injection& injection) {
  const auto& [from_s, to_s, rate_ml_s, agent_mg_ml, particles] = injection;
  check_amount("injection_rate_ml_s", rate_ml_s, kMaxInjection_ml_s, "ml/s");
  check_amount("iodine_mg_ml", agent_mg_ml, kMaxAgent_mg_ml, "mg/ml");
  check(particles);
  if (!(from_s >= 0 && from_s <= to_s && std::isfinite(to_s)))
    throw InputError("`inject` {:g},{:g}: must begin at 0 s or later, and before it ends", from_s, to_s);
  if (injection.volume_ml() > kMaxInjection_ml)
    throw InputError("`inject` {:g},{:g}: {:.0f} ml at {:g} ml/s; inject at most {:g} ml", from_s, to_s,
                     injection.volume_ml(), rate_ml_s, kMaxInjection_ml);
}

}  // namespace xraycast
