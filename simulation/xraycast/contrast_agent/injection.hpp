#pragma once

#include "xraycast/blood_flow/embolisation.hpp"

namespace xraycast {

/// Limits of injectors and agents: aortic injectors give 40 ml/s at most; iomeprol 400 is the densest agent.
inline constexpr double kMaxInjection_ml_s = 50, kMaxInjection_ml = 300, kMaxAgent_mg_ml = 400;

/// An injection of contrast agent at a catheter's tip, at a constant rate between two times.
struct Injection {
  double from_s = 0, to_s = 0;
  double rate_ml_s = 5;
  double agent_mg_ml = 350;  ///< iodine
  Particles particles{};     ///< in the agent

  double volume_ml() const { return rate_ml_s * (to_s - from_s); }

  /// Ends it after a volume, unless it ends before.
  void end_after(double volume_ml);

  /// The mean rate between two other times, the first below the second.
  double mean_rate_ml_s(double begin_s, double end_s) const;
};

/// Throws InputError for times in no order, for more than the limits above, and as check of Particles.
void check(const Injection& injection);

}  // namespace xraycast
