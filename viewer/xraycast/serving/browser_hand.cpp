#include "xraycast/serving/browser_hand.hpp"

#include "xraycast/haptics/hand_rates.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

namespace xraycast {
namespace {

/// The fields of a message; one that is not as it must be makes all of it bad.
class HandMessage {
 public:
  explicit HandMessage(const nlohmann::json& json) : json_(json), is_good_(json.is_object()) {}

  bool is_good() const { return is_good_; }

  double number(const std::string& name, double low, double high, double otherwise) {
    const auto field = find(name);
    if (field == json_.end()) return otherwise;
    const double value = field->is_number() ? field->get<double>() : std::nan("");
    if (!(value >= low && value <= high)) is_good_ = false;
    return value;
  }

  /// {"hold": {"breath": true}, "speed": 2, "gate": {"mode": "heart", "phase": 0.75}}: a mode is held where
  /// it is, or at a phase, or with false goes on; a gate of null is none.
  BodyChanges body(const char* name) {
    BodyChanges changes;
    const auto field = find(name);
    if (field == json_.end()) return changes;
    HandMessage body(*field);
    if (const auto holds = body.find("hold"); holds != field->end()) changes.holds = body.holds(*holds);
    if (body.find("speed") != field->end()) changes.speed = body.number("speed", 0, 100, 1);
    if (const auto gate = body.find("gate"); gate != field->end()) changes.gate = body.gate(*gate);
    if (!body.is_good()) is_good_ = false;
    return changes;
  }

  /// {"instrument": 1, "bar": 8}, of the hubs from the outermost on: an order to one of them.
  std::array<std::optional<double>, kMaxHubs> order(const char* name, const char* unit, double most) {
    std::array<std::optional<double>, kMaxHubs> orders{};
    const auto field = find(name);
    if (field == json_.end()) return orders;
    HandMessage order(*field);
    const std::size_t hub = order.hub();
    const double value = order.number(unit, 0, most, std::nan(""));
    if (!order.is_good() || std::isnan(value))
      is_good_ = false;
    else
      orders[hub] = value;
    return orders;
  }

  /// {"instrument": 1}: something that one of the hubs is to do once.
  std::array<bool, kMaxHubs> deed(const char* name) {
    std::array<bool, kMaxHubs> does{};
    const auto field = find(name);
    if (field == json_.end()) return does;
    HandMessage order(*field);
    const std::size_t hub = order.hub();
    if (order.is_good())
      does[hub] = true;
    else
      is_good_ = false;
    return does;
  }

  /// {"mm": 0.5}; of 0 mm: none.
  std::optional<Particles> particles(const char* name) {
    const auto field = find(name);
    if (field == json_.end()) return std::nullopt;
    HandMessage said(*field);
    const double mm = said.number("mm", 0, Particles::kMost_mm, std::nan(""));
    if (!said.is_good() || !Particles{mm}.are_valid()) {
      is_good_ = false;
      return std::nullopt;
    }
    return Particles{mm};
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
  /// For which an order is; it has to be named.
  std::size_t hub() {
    const double hub = number("instrument", 0, kMaxHubs - 1, std::nan(""));
    if (hub != std::floor(hub)) is_good_ = false;
    return is_good_ ? static_cast<std::size_t>(hub) : 0;
  }

  std::map<std::string, BodyChanges::Hold> holds(const nlohmann::json& modes) {
    constexpr std::size_t kMost = 32;
    std::map<std::string, BodyChanges::Hold> holds;
    if (!modes.is_object() || modes.size() > kMost) is_good_ = false;
    if (!is_good_) return holds;
    HandMessage message(modes);
    for (const auto& [mode, value] : modes.items()) {
      BodyChanges::Hold& hold = holds[mode];
      if (value.is_boolean())
        hold.is_held = value.get<bool>();
      else
        hold.phase = message.number(mode, 0, 1, 0);
    }
    if (!message.is_good()) is_good_ = false;
    return holds;
  }

  std::optional<PhaseGate> gate(const nlohmann::json& value) {
    if (value.is_null()) return std::nullopt;
    HandMessage gate(value);
    const auto mode = gate.find("mode");
    if (!gate.is_good() || mode == value.end() || !mode->is_string()) {
      is_good_ = false;
      return std::nullopt;
    }
    const PhaseGate found{mode->get<std::string>(), gate.number("phase", 0, 1, 0)};
    if (!gate.is_good()) is_good_ = false;
    return found;
  }

  nlohmann::json::const_iterator find(const std::string& name) const {
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
  said.body = message.body("body");
  constexpr double kMost_bar = 100, kMost_mm = 1000;
  said.balloons_bar = message.order("balloon", "bar", kMost_bar);
  said.sheaths_mm = message.order("sheath", "mm", kMost_mm);
  said.detaches = message.deed("detach");
  said.particles = message.particles("particles");
  if (!message.is_good()) return false;

  constexpr int kMost = 100;  // that are kept while nobody asks
  const std::lock_guard lock(mutex_);
  received_ = now;
  said.next_hubs = std::min(kMost, said.next_hubs + commands_.next_hubs);
  said.valve_toggles = std::min(kMost, said.valve_toggles + commands_.valve_toggles);
  if (!said.c_arm) said.c_arm = commands_.c_arm;
  if (!said.particles) said.particles = commands_.particles;
  for (std::size_t hub = 0; hub < kMaxHubs; ++hub) {
    if (!said.balloons_bar[hub]) said.balloons_bar[hub] = commands_.balloons_bar[hub];
    said.detaches[hub] = said.detaches[hub] || commands_.detaches[hub];
    if (!said.sheaths_mm[hub]) said.sheaths_mm[hub] = commands_.sheaths_mm[hub];
  }
  BodyChanges body = std::move(commands_.body);
  body.add(said.body);
  said.body = std::move(body);
  commands_ = std::move(said);
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
  commands_.balloons_bar = commands_.sheaths_mm = {};
  commands_.detaches = {};
  commands_.particles.reset();
  commands_.body = {};
  return commands;
}

}  // namespace xraycast
