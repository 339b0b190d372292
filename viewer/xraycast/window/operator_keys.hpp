#pragma once

#include "xraycast/fluoroscope/exposure.hpp"

#include <string>
#include <vector>

namespace xraycast {

/// What keys and advice depend on.
struct OperatorState {
  // A run.
  bool steers = false;
  bool is_steered_by_keys = false, is_steered_by_mouse = false;
  bool has_valve = false, has_agent_outlet = false, injects = false;
  bool is_recording = false, has_recording = false;
  bool has_exercise = false;
  bool follows = false;         ///< the table follows the tip
  bool shows_road_map = false;  ///< or, without a fluoroscope, the vessels' outline

  // A fluoroscope.
  bool exposes = false;
  bool is_live = false;  ///< the pedal is down
  bool is_automatic = true;
  DoseLevel dose = DoseLevel::normal;
  bool subtracts = false, is_masking = false, has_angiogram = false;

  // A body in motion.
  bool has_breath = false, holds_breath = false;
  bool has_heart = false, holds_heart = false;
  double speed = 1;
  std::string gate{};  ///< in words, empty without one
  bool opens_gate = true;
};

/// A key, or several, and what it does now: `X`, `X-rays (hold)`.
struct KeyHint {
  std::string keys, does;
};

/// The operator's keys that do something now, the most important first.
std::vector<KeyHint> usable_keys(const OperatorState& state);

/// What the operator should do next or otherwise, one line each; mostly none.
std::vector<std::string> advice_on(const OperatorState& state);

/// An exercise's limit, by its field in the file, as it is read beside its value: `time, s`.
std::string words_of_limit(const std::string& name);

}  // namespace xraycast
