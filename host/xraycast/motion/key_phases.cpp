#include "xraycast/motion/key_phases.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"

#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

using nlohmann::json;

/// Of the same modes, without displacements. Those that do not wrap have two different ones.
Motion rhythm_of(const Motion& motion) {
  std::vector<MotionMode> modes;
  for (const MotionMode& mode : motion.modes()) {
    MotionMode& still = modes.emplace_back(MotionMode{mode.name, mode.period_s, mode.waveform, {}});
    if (mode.wraps())
      still.keys = {{0, nullptr}, {0.5, nullptr}};
    else
      still.keys = {{0, nullptr}, {1, affine_displacement(glm::dmat3(1), glm::dvec3(0))}};
  }
  return {std::move(modes), motion.name()};
}

void check_phases(const MotionMode& mode, const std::vector<double>& phases, const std::string& name) {
  const int most = KeyPhases::kMostOfMode;
  if (std::ssize(phases) < 2 || std::ssize(phases) > most)
    throw InputError("{}: mode {} has {} key phases, but must have 2 to {}", name, mode.name, phases.size(),
                     most);
  // Written so that NaN does not ascend.
  const bool ascends =
      std::ranges::adjacent_find(phases, [](double a, double b) { return !(a < b); }) == phases.end();
  if (!ascends || phases.front() != 0 || (mode.wraps() ? phases.back() >= 1 : phases.back() != 1))
    throw InputError("{}: key phases {} of mode {} must ascend from 0 to {}1", name, fmt::join(phases, ", "),
                     mode.name, mode.wraps() ? "below " : "");
}

json to_json(const MotionMode& mode, const std::vector<double>& phases) {
  json one{{"name", mode.name}, {"wraps", mode.wraps()}, {"phases", phases}};
  if (mode.waveform.empty())
    one["period_s"] = mode.period_s;
  else
    for (const PhaseSample& sample : mode.waveform) one["waveform"].push_back({sample.time_s, sample.phase});
  return one;
}

MotionMode mode_of(const json& one) {
  MotionMode mode{one.at("name").get<std::string>(), one.value("period_s", 0.0), {}, {{0, nullptr}}};
  if (one.contains("waveform"))
    for (const auto& [time_s, phase] : one.at("waveform").get<std::vector<std::array<double, 2>>>())
      mode.waveform.push_back({time_s, phase});
  if (one.at("wraps").get<bool>())
    mode.keys.push_back({0.5, nullptr});
  else
    mode.keys.push_back({1, affine_displacement(glm::dmat3(1), glm::dvec3(0))});
  return mode;
}

}  // namespace

KeyPhases::KeyPhases(const Motion& motion, std::vector<std::vector<double>> phases)
    : rhythm_(rhythm_of(motion)), phases_(std::move(phases)) {
  if (phases_.size() != rhythm_.modes().size())
    throw InputError("{}: key phases of {} modes for {}; give those of each", motion.name(), phases_.size(),
                     rhythm_.modes().size());
  std::int64_t count = 1;
  for (std::size_t m = 0; m < phases_.size(); ++m) {
    check_phases(rhythm_.modes()[m], phases_[m], motion.name());
    count *= std::ssize(phases_[m]);
    if (count > kMost)
      throw InputError("{}: its modes' key phases make more than {} keys; give fewer", motion.name(), kMost);
  }
}

int KeyPhases::count() const {
  int count = 1;
  for (const std::vector<double>& of_mode : phases_) count *= static_cast<int>(of_mode.size());
  return count;
}

std::vector<double> KeyPhases::phases_of(int key) const {
  std::vector<double> phases(phases_.size());
  for (std::size_t m = phases_.size(); m-- > 0;) {
    const auto size = static_cast<int>(phases_[m].size());
    phases[m] = phases_[m][static_cast<std::size_t>(key % size)];
    key /= size;
  }
  return phases;
}

int KeyPhases::base_of(int key) const {
  int stride = 1;
  for (std::size_t m = phases_.size(); m-- > 0;) {
    const auto size = static_cast<int>(phases_[m].size());
    if (const int index = key / stride % size; index > 0) return key - index * stride;
    stride *= size;
  }
  return -1;
}

std::vector<KeyPhases::Share> KeyPhases::shares_at(std::span<const double> phases) const {
  std::vector<Share> shares{{0, 1}};
  for (std::size_t m = 0; m < phases_.size(); ++m) {
    const std::vector<double>& keys = phases_[m];
    const bool wraps = rhythm_.modes()[m].wraps();
    const double phase = wraps ? phases[m] - std::floor(phases[m]) : std::clamp(phases[m], 0.0, 1.0);
    const auto above = std::ranges::upper_bound(keys, phase) - keys.begin();
    const auto count = static_cast<std::ptrdiff_t>(keys.size());
    const std::ptrdiff_t below = std::max<std::ptrdiff_t>(0, above - 1), next = above < count ? above : 0;
    double weight = 0;  // of the next; none behind the last of a mode that does not wrap
    if (above < count || wraps) {
      const double start = keys[static_cast<std::size_t>(below)],
                   end = above < count ? keys[static_cast<std::size_t>(above)] : 1 + keys.front();
      weight = (phase - start) / (end - start);
    }
    std::vector<Share> finer;
    for (const auto& [key, share] : shares) {
      const int first = key * static_cast<int>(count);
      if (weight < 1) finer.push_back({first + static_cast<int>(below), share * (1 - weight)});
      if (weight > 0) finer.push_back({first + static_cast<int>(next), share * weight});
    }
    shares = std::move(finer);
  }
  return shares;
}

std::string KeyPhases::to_json() const {
  json modes = json::array();
  for (std::size_t m = 0; m < phases_.size(); ++m)
    modes.push_back(xraycast::to_json(rhythm_.modes()[m], phases_[m]));
  return json{{"modes", modes}}.dump();
}

KeyPhases KeyPhases::from_json(const std::string& text, const std::string& name) {
  std::vector<MotionMode> modes;
  std::vector<std::vector<double>> phases;
  try {
    const json document = parse_json(text, name);
    for (const json& one : document.at("modes")) {
      modes.push_back(mode_of(one));
      phases.push_back(one.at("phases").get<std::vector<double>>());
    }
  } catch (const json::exception&) {
    throw InputError("{}: is no list of modes with their phases; cast it again", name);
  }
  return {Motion(std::move(modes), name), std::move(phases)};
}

KeyPhases key_phases(const Motion& motion, const std::map<std::string, int>& keys) {
  std::vector<std::vector<double>> phases;
  for (const auto& [mode, count] : keys)
    motion.number_of(mode, fmt::format("`keys` {}={}", excerpt(mode), count));
  for (const MotionMode& mode : motion.modes()) {
    const auto given = keys.find(mode.name);
    const int count = given != keys.end() ? given->second : mode.wraps() ? kUsualOfCycle : kUsualOfStretch;
    if (count < 2 || count > KeyPhases::kMostOfMode)
      throw InputError("`keys` {}={}: must be 2 to {}", mode.name, count, KeyPhases::kMostOfMode);
    std::vector<double>& of_mode = phases.emplace_back();
    for (int i = 0; i < count; ++i) of_mode.push_back(double(i) / (mode.wraps() ? count : count - 1));
  }
  return {motion, std::move(phases)};
}

}  // namespace xraycast
