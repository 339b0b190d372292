#pragma once

#include "xraycast/mechanics/instrument_model.hpp"

#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

namespace xraycast {

/// A coil on its wire.
struct PushedCoil {
  CoilModel model;
  std::size_t around = 0;  ///< the instrument that it comes out of
  double out_mm = 0;       ///< of it, beyond the tip of that; negative: its far end is so far behind
  double laid_mm = 0;      ///< of it, in a sac
  bool is_in_sac = false;  ///< it can be pushed out there
  /// Of a coil, what may still be in its catheter as it is detached: a hub's motion needs no more decimals.
  static constexpr double kSlack_mm = 0.5;
  /// Its far end is out, but not where it could be pushed on.
  bool is_outside() const { return !is_in_sac && out_mm >= 0; }
  bool can_be_detached() const { return laid_mm >= model.length_mm - kSlack_mm; }
};

/// A wire that pushes coils, one after the other: the coil ahead of it, and what was asked for in vain. Of an
/// instrument without coils it says so.
struct CoilPusher {
  /// As many detachments as anybody may ask for.
  static constexpr double kMostDetached = 1000;
  /// A coil that was to be detached before all of it lay in a sac.
  struct Refused {
    double time_s = 0;                  ///< as Instruments::time_s()
    double laid_mm = 0, length_mm = 0;  ///< 0 of 0: there was no coil on the wire
  };

  std::vector<CoilModel> coils{};
  int detached = 0;                  ///< so far
  bool is_attached = false;          ///< the next one is on the wire
  std::optional<std::size_t> sac{};  ///< in which part of it lies
  bool is_in_sac = false;  ///< the tip that it comes out of is in that sac, or in one that it can go into
  double held_back_s = 0;  ///< for so long it was to go on where no sac is
  std::vector<Refused> refused{};

  explicit CoilPusher(const InstrumentModel& model) : coils(model.coils()), is_attached(model.has_coils()) {}

  bool has_coils() const { return !coils.empty(); }
  /// On the wire, or the last one that was: as long as the wire is in, its length counts.
  const CoilModel& coil() const {
    const auto number = static_cast<std::size_t>(is_attached ? detached : detached - 1);
    return coils[number < coils.size() ? number : coils.size() - 1];
  }
  double ahead_mm() const { return has_coils() ? coil().length_mm : 0; }

  void take_next() { is_attached = true; }

  /// Whether the coil is detached, as the hub asks for another one with so much of it in the sac.
  bool detaches(double asked, double laid_mm, double time_s) {
    if (laid_mm < coil().length_mm - PushedCoil::kSlack_mm) {
      refuse_detaching(asked, laid_mm, time_s);
      return false;
    }
    if (!takes(asked)) return false;
    ++detached;
    is_attached = is_in_sac = false;
    return true;
  }
  void refuse_detaching(double asked, double laid_mm, double time_s) {
    if (takes(asked)) refused.push_back({time_s, laid_mm, is_attached ? coil().length_mm : 0});
  }

  /// The hub was to be further in than it could. Where it waits for what goes in around it, nothing is amiss.
  void note(double target_mm, double largest_mm, double step_s) {
    constexpr double kNoticed_mm = 0.01;
    const bool waits = largest_mm != largest_mm_;
    largest_mm_ = largest_mm;
    if (has_coils() && is_attached && !is_in_sac && !waits && target_mm - largest_mm > kNoticed_mm)
      held_back_s += step_s;
  }

 private:
  bool takes(double asked) {
    constexpr double kRounding = 1e-6;
    if (std::floor(asked + kRounding) <= taken_) return false;
    ++taken_;
    return true;
  }
  double largest_mm_ = -1;  ///< of the last step
  double taken_ = 0;        ///< detachments that were asked for and answered
};

}  // namespace xraycast
