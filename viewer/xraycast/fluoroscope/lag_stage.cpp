#include "xraycast/fluoroscope/lag_stage.hpp"

#include "xraycast/fluoroscope/pixel_loops.hpp"

#include <cmath>

namespace xraycast {

LagStage::LagStage(const PictureSize& size, std::span<const LagTrap> traps, double pulses_per_s)
    : size_(size) {
  for (const LagTrap& trap : traps)
    traps_.push_back({static_cast<float>(trap.fraction),
                      static_cast<float>(-std::expm1(-1 / (pulses_per_s * trap.time_s))),
                      PixelPlane(size.pixels(), 0.0f)});
}

void LagStage::hold_row(int j, float* signal_kev) {
  thread_local PixelPlane before;
  before.assign(signal_kev, signal_kev + size_.width);
  for (Trap& trap : traps_)
    lag_row(trap.fraction, trap.decayed, size_.width, before.data(), trap.kept.data() + size_.row(j),
            signal_kev);
}

}  // namespace xraycast
