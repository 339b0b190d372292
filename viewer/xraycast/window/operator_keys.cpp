#include "xraycast/window/operator_keys.hpp"

#include <fmt/format.h>

#include <map>

namespace xraycast {
namespace {

void add_steering(const OperatorState& state, std::vector<KeyHint>& keys) {
  if (state.is_steered_by_keys) {
    keys.push_back({"↑ ↓", "advance, withdraw"});
    keys.push_back({"← →", "turn"});
    keys.push_back({"Shift", "slowly"});
  }
  if (state.is_steered_by_mouse) keys.push_back({"Ctrl drag", "advance, turn"});
  if (state.has_agent_outlet) keys.push_back({"I", "contrast (hold)"});
  if (!state.has_valve) return;
  keys.push_back({"Tab", "next instrument"});
  keys.push_back({"V", "valve"});
}

KeyHint road_map_key(const OperatorState& state) {
  return {"M", state.shows_road_map ? "road map: on" : "road map"};
}

void add_exposure(const OperatorState& state, std::vector<KeyHint>& keys) {
  keys.push_back({"D", fmt::format("dose: {}", to_string(state.dose))});
  keys.push_back({"G", state.subtracts ? "subtraction: on" : "subtraction"});
  if (state.subtracts && !state.is_masking) keys.push_back({"N", "new mask"});
  if (state.has_angiogram) keys.push_back(road_map_key(state));
}

void add_run(const OperatorState& state, std::vector<KeyHint>& keys) {
  keys.push_back({"T", state.follows ? "table follows: on" : "table follows: off"});
  keys.push_back({"Enter", state.is_recording ? "stop recording" : "record"});
  if (state.has_recording && !state.is_recording) keys.push_back({"L", "replay"});
  keys.push_back({"Backspace", "restart"});
  if (state.has_exercise) keys.push_back({"Ctrl+R", "save report"});
}

void add_body(const OperatorState& state, std::vector<KeyHint>& keys) {
  if (state.has_breath) keys.push_back({"B", state.holds_breath ? "breathe on" : "hold breath"});
  if (state.has_heart) keys.push_back({"K", state.holds_heart ? "heart beats on" : "arrest heart"});
  if (!state.has_breath && !state.has_heart) return;
  keys.push_back({"W", state.gate.empty() ? "gate" : "gate: on"});
  keys.push_back({", .", fmt::format("speed: {:g}", state.speed)});
}

}  // namespace

std::vector<KeyHint> usable_keys(const OperatorState& state) {
  std::vector<KeyHint> keys;
  if (state.steers || state.exposes) keys.push_back({"X", "X-rays (hold)"});
  if (state.steers) add_steering(state, keys);
  if (state.exposes)
    add_exposure(state, keys);
  else if (state.steers)
    keys.push_back(road_map_key(state));
  add_body(state, keys);
  if (state.steers) add_run(state, keys);
  keys.push_back({"P", "save picture"});
  keys.push_back({"E", state.exposes ? "fluoroscope off" : "fluoroscope"});
  keys.push_back({"A", "all controls"});
  keys.push_back({"H", "all keys"});
  return keys;
}

std::vector<std::string> advice_on(const OperatorState& state) {
  std::vector<std::string> advice;
  if (state.is_live && !state.opens_gate)
    advice.push_back(fmt::format("The gate never opens ({}): let the body go on, or press W", state.gate));
  if (state.injects && !state.has_agent_outlet)
    advice.push_back("No lumen is free for contrast agent: draw the wire back to 0 mm");
  if (!state.exposes || !state.subtracts) return advice;
  if (state.is_automatic && state.dose != DoseLevel::cine)
    advice.push_back(fmt::format("Subtraction is noisy at {} dose: press D{} for cine", to_string(state.dose),
                                 state.dose == DoseLevel::low ? " twice" : ""));
  if (state.is_masking && state.is_live)
    advice.push_back("Mask: keep still");
  else if (state.is_masking)
    advice.push_back("Subtraction: hold X for the mask, then I as well for contrast agent");
  return advice;
}

std::string words_of_limit(const std::string& name) {
  static const std::map<std::string, const char*> words{{"time_s", "time, s:"},
                                                        {"fluoroscopy_s", "fluoroscopy, s:"},
                                                        {"air_kerma_mGy", "air kerma, mGy:"},
                                                        {"dap_Gycm2", "dose-area, Gy cm²:"},
                                                        {"contrast_ml", "contrast, ml:"},
                                                        {"force_N", "force at a hub, N:"},
                                                        {"wall_force_N", "force on a wall, N:"}};
  const auto at = words.find(name);
  return at == words.end() ? name : at->second;
}

}  // namespace xraycast
