#include "xraycast/serving/browser_hand.hpp"

#include "xraycast/haptics/hand_rates.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

/// The fields of a message; one that is not as it must be makes all of it bad.
class HandMessage {
 public:
  explicit HandMessage(const nlohmann::json& json) : json_(json), is_good_(json.is_object()) {}

  bool is_good() const { return is_good_; }

  double number(const char* name, double low, double high, double otherwise) {
    const auto field = find(name);
    if (field == json_.end()) return otherwise;
    const double value = field->is_number() ? field->get<double>() : std::nan("");
    if (!(value >= low && value <= high)) is_good_ = false;
    return value;
  }

  bool flag(const char* name) {
    const auto field = find(name);
    if (field == json_.end()) return false;
    if (!field->is_boolean()) is_good_ = false;
    return field->is_boolean() && field->get<bool>();
  }

  std::optional<CArmRequest> c_arm(const char* name, double mid_height_mm) {
    const auto field = find(name);
    if (field == json_.end()) return std::nullopt;
    HandMessage pose(*field);
    constexpr double kDegree = std::numbers::pi / 180, kFar_mm = 1e4;
    CArmRequest request;
    request.lao_rad = kDegree * pose.number("lao_deg", -360, 360, 0);
    request.cranial_rad = kDegree * pose.number("cranial_deg", -90, 90, 0);
    request.zoom = pose.number("zoom", CArmPose::kMinZoom, CArmPose::kMaxZoom, 1);
    request.centre_z_mm = mid_height_mm + pose.number("table_mm", -kFar_mm, kFar_mm, 0);
    if (!pose.is_good()) is_good_ = false;
    return request;
  }

 private:
  nlohmann::json::const_iterator find(const char* name) const {
    return json_.is_object() ? json_.find(name) : json_.end();
  }

  const nlohmann::json& json_;
  bool is_good_;
};

}  // namespace

bool BrowserHand::receive(std::string_view text, Clock::time_point now) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  HandMessage message(json);
  const double speed = message.flag("slow") ? kSlowly : 1;
  LiveCommands said;
  said.insertion_mm_s = speed * kPush_mm_s * message.number("push", -1, 1, 0);
  said.rotation_rad_s = speed * kRotate_rad_s * message.number("turn", -1, 1, 0);
  said.pedal = message.flag("pedal");
  said.injection_ml_s = message.flag("inject") ? kInjection_ml_s : 0;
  said.next_hubs = message.flag("next_hub") ? 1 : 0;
  said.valve_toggles = message.flag("valve") ? 1 : 0;
  said.c_arm = message.c_arm("c_arm", mid_height_mm_);
  if (!message.is_good()) return false;

  constexpr int kMost = 100;  // that are kept while nobody asks
  const std::lock_guard lock(mutex_);
  received_ = now;
  said.next_hubs = std::min(kMost, said.next_hubs + commands_.next_hubs);
  said.valve_toggles = std::min(kMost, said.valve_toggles + commands_.valve_toggles);
  if (!said.c_arm) said.c_arm = commands_.c_arm;
  commands_ = said;
  return true;
}

void BrowserHand::let_go() {
  const std::lock_guard lock(mutex_);
  commands_ = {};
}

LiveCommands BrowserHand::commands(Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  LiveCommands commands = commands_;
  if (now - received_ > kSilence) {
    commands.insertion_mm_s = commands.rotation_rad_s = commands.injection_ml_s = 0;
    commands.pedal = false;
  }
  commands_.next_hubs = commands_.valve_toggles = 0;
  commands_.c_arm.reset();
  return commands;
}

}  // namespace xraycast
