#pragma once

#include "xraycast/display/picture_rows.hpp"
#include "xraycast/fluoroscope/c_arm.hpp"

#include <span>

namespace xraycast {

/// Charge of earlier pulses. The first pulse finds the traps empty.
class LagStage {
 public:
  LagStage(const PictureSize& size, std::span<const LagTrap> traps, double pulses_per_s);

  /// Holds charge of a row back, and releases what was held back before; rows in any order, on any threads.
  void hold_row(int j, float* signal_kev);

  /// Leaves in a row's traps what many pulses of that signal leave.
  void fill_row(int j, const float* signal_kev);

  /// Lets out what decays in a pause.
  void pause(double seconds);

 private:
  struct Trap {
    double time_s;
    float fraction, decayed;  ///< from one pulse to the next
    PixelPlane kept;
  };
  PictureSize size_;
  std::vector<Trap> traps_;
};

}  // namespace xraycast
