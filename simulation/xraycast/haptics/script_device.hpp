#pragma once

#include "xraycast/haptics/haptic_device.hpp"
#include "xraycast/simulation/script.hpp"

#include <string>
#include <utility>

namespace xraycast {

/// Replays a script in real time from the first call on. No force feedback.
class ScriptDevice final : public HapticDevice {
 public:
  ScriptDevice(Script script, std::string name) : script_(std::move(script)), name_(std::move(name)) {}

  HandPose pose() override {
    constexpr double kCall_s = 1e-3;  // see HapticDevice
    ++count_;
    return {script_.pose_at(kCall_s * static_cast<double>(count_)), count_};
  }

  void feel(const HubLoad&) override {}
  bool is_rigid() const override { return true; }
  std::string status() const override { return name_; }

 private:
  Script script_;
  std::string name_;
  std::uint64_t count_ = 0;
};

}  // namespace xraycast
