#pragma once

#include "xraycast/catheter/hub.hpp"
#include "xraycast/haptics/haptic_device.hpp"
#include "xraycast/simulation/script.hpp"

#include <array>
#include <filesystem>
#include <string>
#include <utility>

namespace xraycast {

/// Replays a script in real time from the first call on. No force feedback.
class ScriptDevice final : public HapticDevice {
 public:
  explicit ScriptDevice(Script script)
      : script_(std::move(script)), name_(std::filesystem::path(script_.origin()).filename().string()) {}

  HandPose pose(std::size_t hub) override {
    constexpr double kCall_s = 1e-3;  // see HapticDevice
    const std::uint64_t count = ++counts_[hub];
    return {script_.pose_at(kCall_s * static_cast<double>(count), hub), count};
  }

  void set_load(std::size_t, const HubLoad&) override {}
  void go_on_from(std::size_t, const HubPose&) override {}
  bool is_rigid() const override { return true; }
  std::string status() const override { return name_; }

 private:
  Script script_;
  std::string name_;
  std::array<std::uint64_t, kMaxHubs> counts_{};
};

}  // namespace xraycast
