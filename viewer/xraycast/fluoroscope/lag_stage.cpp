#include "xraycast/fluoroscope/lag_stage.hpp"

#include "xraycast/fluoroscope/pixel_loops.hpp"

#include <cmath>

namespace xraycast {

LagStage::LagStage(const PictureSize& size, std::span<const LagTrap> traps, double pulses_per_s)
    : size_(size) {
  for (const LagTrap& trap : traps)
    traps_.push_back({trap.time_s, static_cast<float>(trap.fraction),
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

void LagStage::fill_row(int j, const float* signal_kev) {
  for (Trap& trap : traps_)
    for (int i = 0; i < size_.width; ++i)
      trap.kept[size_.row(j) + static_cast<std::size_t>(i)] = trap.fraction / trap.decayed * signal_kev[i];
}

void LagStage::pause(double seconds) {
  for (Trap& trap : traps_) {
    const auto left = static_cast<float>(std::exp(-seconds / trap.time_s));
    for (float& kept : trap.kept) kept *= left;
  }
}

}  // namespace xraycast
