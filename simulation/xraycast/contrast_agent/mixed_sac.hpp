#pragma once

#include <algorithm>

namespace xraycast {

/// Contrast agent in the sac of an aneurysm, well mixed: dc/dt = q / V (c_vessel - c), so that a sac beside a
/// vessel with a constant concentration fills with the time constant V / q. Agent that is injected in it
/// leaves it as the blood that it displaces does.
class MixedSac {
 public:
  explicit MixedSac(double volume_ml) : volume_ml_(volume_ml) {}

  /// What blood has room in, beside coils. The agent stays.
  void set_volume_ml(double volume_ml) { volume_ml_ = volume_ml; }

  double in_sac_mg() const { return mg_; }
  double mg_ml() const { return mg_ / volume_ml_; }

  /// What is exchanged and injected from now on.
  void set_flow(double exchanged_ml_s, double injected_ml_s, double injected_mg_ml) {
    exchanged_ml_s_ = exchanged_ml_s;
    injected_ml_s_ = injected_ml_s;
    injected_mg_ml_ = injected_mg_ml;
  }
  /// In a step: what it takes from the vessel, not more than half of what it holds; and the agent that leaves
  /// it, with as much blood and what is injected.
  double taken_ml(double time_s) const { return std::min(exchanged_ml_s_ * time_s, 0.5 * volume_ml_); }
  double leaving_mg(double time_s) const {
    return std::min(mg_, (taken_ml(time_s) + injected_ml_s_ * time_s) * mg_ml());
  }
  /// Returns what it takes from the vessel, with a concentration.
  double advance(double time_s, double vessel_mg_ml) {
    const double taken_mg = taken_ml(time_s) * vessel_mg_ml;
    mg_ += taken_mg + injected_ml_s_ * injected_mg_ml_ * time_s - leaving_mg(time_s);
    return taken_mg;
  }

 private:
  double volume_ml_;
  double mg_ = 0;
  double exchanged_ml_s_ = 0, injected_ml_s_ = 0, injected_mg_ml_ = 0;
};

}  // namespace xraycast
