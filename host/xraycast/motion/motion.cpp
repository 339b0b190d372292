#include "xraycast/motion/motion.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"

#include <fmt/ranges.h>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

namespace xraycast {
namespace {

void check_keys(const MotionMode& mode, const std::string& name) {
  if (mode.keys.size() < 2)
    throw InputError("{}: phases holds {}, but must hold two at least", name,
                     pluralize(std::ssize(mode.keys), "phase"));
  for (std::size_t k = 0; k < mode.keys.size(); ++k) {
    const double phase = mode.keys[k].phase;
    if (!(phase >= 0 && phase <= 1)) throw InputError("{}: phase {} must be 0 to 1", name, phase);
    if (k > 0 && !(phase > mode.keys[k - 1].phase))
      throw InputError("{}: phase {} follows {}; phases must ascend", name, phase, mode.keys[k - 1].phase);
  }
}

constexpr double kLeastTime_s = 1e-3;  // of what a body does; far less makes phases that are no numbers

void check_waveform(const MotionMode& mode, const std::string& name) {
  const std::vector<PhaseSample>& samples = mode.waveform;
  if (samples.size() < 2) throw InputError("{}: waveform holds one sample, but must hold two at least", name);
  constexpr double kLongest_s = 1e6, kMostCycles = 1e6;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!(std::abs(samples[i].time_s) <= kLongest_s))
      throw InputError("{}: a time of waveform is {} s; it must be within {:g} s", name, samples[i].time_s,
                       kLongest_s);
    if (i > 0 && !(samples[i].time_s >= samples[i - 1].time_s + kLeastTime_s))
      throw InputError("{}: in waveform {} s follows {} s; times must ascend, by 0.001 s at least", name,
                       samples[i].time_s, samples[i - 1].time_s);
    const double most = mode.wraps() ? kMostCycles : 1, least = mode.wraps() ? -kMostCycles : 0;
    if (!(samples[i].phase >= least && samples[i].phase <= most))
      throw InputError("{}: a phase of waveform is {}; it must be {:g} to {:g}", name, samples[i].phase,
                       least, most);
  }
  const double growth = samples.back().phase - samples.front().phase;
  constexpr double kRounding = 1e-9;
  if (std::abs(growth - (mode.wraps() ? std::round(growth) : 0)) > kRounding)
    throw InputError("{}: waveform jumps where it repeats, from phase {} to {}; it must end as it begins",
                     name, samples.back().phase, samples.front().phase);
}

void check_time(const MotionMode& mode, const std::string& name) {
  if (!mode.waveform.empty() && mode.period_s != 0)
    throw InputError("{}: has both period_s and waveform; leave one of them out", name);
  if (!mode.waveform.empty()) return check_waveform(mode, name);
  constexpr double kLongest_s = 1e6;
  if (!(mode.period_s >= kLeastTime_s && mode.period_s <= kLongest_s))
    throw InputError("{}: period_s is {}; it must be {:g} to {:g}", name, mode.period_s, kLeastTime_s,
                     kLongest_s);
}

void check_modes(const std::vector<MotionMode>& modes, const std::string& name) {
  if (modes.empty()) throw InputError("{}: has no modes; give one at least", name);
  std::set<std::string> names;
  for (const MotionMode& mode : modes) {
    if (mode.name.empty() || mode.name.find_first_of("=,/ \t\n") != std::string::npos)
      throw InputError("{}: a mode's name is '{}'; it must be a word without =, / and commas", name,
                       excerpt(mode.name));
    if (!names.insert(mode.name).second)
      throw InputError("{}: two modes are named {}; rename one", name, excerpt(mode.name));
    const std::string of_mode = fmt::format("{}: mode {}", name, excerpt(mode.name));
    check_keys(mode, of_mode);
    check_time(mode, of_mode);
  }
}

/// Where a mode's displacements fold, each once.
void warn_of_folds(const MotionMode& mode, std::vector<std::string>& warnings) {
  std::set<const Displacement*> seen;
  for (const KeyPhase& key : mode.keys) {
    if (!key.moves || !seen.insert(key.moves.get()).second) continue;
    const Displacement::Folds folds = key.moves->folds();
    if (folds.nodes == 0) continue;
    const glm::dvec3& at = folds.first_mm;
    warnings.push_back(
        fmt::format("the field of {} at phase {:g} folds at {} of {} (Jacobian determinant down to {:.2g}, "
                    "first at {:.0f}, {:.0f}, {:.0f} mm): tissue shows twice there, and its inverse is not "
                    "unique; smooth the field",
                    mode.name, key.phase, folds.nodes, pluralize(folds.of, "node"), folds.least_determinant,
                    at.x, at.y, at.z));
  }
}

/// What is summed at a phase, each displacement once.
std::vector<HeldMotion::Part> parts_of(const MotionMode& mode, double phase) {
  const std::vector<double> weights = mode.weights_at(phase);
  std::vector<HeldMotion::Part> parts;
  for (std::size_t k = 0; k < weights.size(); ++k) {
    const auto& moves = mode.keys[k].moves;
    if (!moves || weights[k] == 0) continue;
    const auto same = std::find_if(parts.begin(), parts.end(),
                                   [&](const HeldMotion::Part& part) { return part.moves == moves; });
    if (same == parts.end())
      parts.push_back({weights[k], moves});
    else
      same->weight += weights[k];
  }
  return parts;
}

}  // namespace

// ---- held ---------------------------------------------------------------------------------------------

glm::dvec3 HeldMotion::displacement_mm(const glm::dvec3& x_mm) const {
  glm::dvec3 place_mm = x_mm;
  for (const std::vector<Part>& mode : modes_) {
    glm::dvec3 sum_mm(0);
    for (const Part& part : mode) sum_mm += part.weight * part.moves->at(place_mm);
    place_mm += sum_mm;
  }
  return place_mm - x_mm;
}

void HeldMotion::displace(std::span<glm::dvec3> x_mm) const {
  std::vector<glm::dvec3> sum_mm(x_mm.size());
  for (const std::vector<Part>& mode : modes_) {
    std::fill(sum_mm.begin(), sum_mm.end(), glm::dvec3(0));
    for (const Part& part : mode) part.moves->add(x_mm, part.weight, sum_mm);
    for (std::size_t i = 0; i < x_mm.size(); ++i) x_mm[i] += sum_mm[i];
  }
}

bool HeldMotion::covers(const glm::dvec3& x_mm) const {
  glm::dvec3 place_mm = x_mm;
  for (const std::vector<Part>& mode : modes_) {
    glm::dvec3 sum_mm(0);
    for (const Part& part : mode) {
      if (!part.moves->covers(place_mm)) return false;
      sum_mm += part.weight * part.moves->at(place_mm);
    }
    place_mm += sum_mm;
  }
  return true;
}

glm::dmat3 HeldMotion::jacobian(const glm::dvec3& x_mm) const {
  constexpr double kHalf_mm = 0.05;
  glm::dmat3 jacobian(1);
  for (int axis = 0; axis < 3; ++axis) {
    glm::dvec3 offset(0);
    offset[axis] = kHalf_mm;
    jacobian[axis] += (displacement_mm(x_mm + offset) - displacement_mm(x_mm - offset)) / (2 * kHalf_mm);
  }
  return jacobian;
}

InverseResult HeldMotion::inverse_mm(const glm::dvec3& y_mm, const glm::dvec3& guess_mm) const {
  constexpr int kMostSteps = 60, kMostHalvings = 12;
  constexpr double kEnough_mm = 1e-4, kContracts = 0.5;
  const auto excess = [&](const glm::dvec3& x_mm) { return x_mm + displacement_mm(x_mm) - y_mm; };
  glm::dvec3 x_mm = guess_mm, excess_mm = excess(x_mm);
  double residual_mm = glm::length(excess_mm);
  for (int step = 0; step < kMostSteps && residual_mm > kEnough_mm; ++step) {
    // A fixed point where the displacement varies slowly, else Newton's step, shortened until it helps.
    glm::dvec3 next_mm = x_mm - excess_mm, next_excess_mm = excess(next_mm);
    if (!(glm::length(next_excess_mm) < kContracts * residual_mm)) {
      const glm::dmat3 slope = jacobian(x_mm);
      const bool is_usable = std::abs(glm::determinant(slope)) > 1e-6;
      const glm::dvec3 way_mm = is_usable ? glm::inverse(slope) * excess_mm : excess_mm;
      double share = 1;
      for (int halving = 0; halving < kMostHalvings; ++halving, share *= 0.5) {
        next_mm = x_mm - share * way_mm;
        next_excess_mm = excess(next_mm);
        if (glm::length(next_excess_mm) < residual_mm) break;
      }
    }
    if (!(glm::length(next_excess_mm) < residual_mm)) break;
    x_mm = next_mm;
    excess_mm = next_excess_mm;
    residual_mm = glm::length(excess_mm);
  }
  return {x_mm, residual_mm, residual_mm < kInverseResidual_mm};
}

// ---- motion -------------------------------------------------------------------------------------------

Motion::Motion(std::vector<MotionMode> modes, std::string name, std::vector<std::string> warnings)
    : name_(std::move(name)), modes_(std::move(modes)), warnings_(std::move(warnings)) {
  check_modes(modes_, name_);
  for (const MotionMode& mode : modes_) warn_of_folds(mode, warnings_);
}

std::vector<double> Motion::phases_at(double time_s) const {
  std::vector<double> phases;
  for (const MotionMode& mode : modes_) phases.push_back(mode.phase_at(time_s));
  return phases;
}

std::vector<double> Motion::phases_of(const std::map<std::string, double>& named) const {
  std::vector<double> phases(modes_.size(), 0.0);
  for (const auto& [mode, phase] : named) {
    const std::string asked = fmt::format("`phase` {}={}", excerpt(mode), phase);
    const std::size_t number = number_of(mode, asked);
    if (!(phase >= 0 && phase <= 1)) throw InputError("{}: must be 0 to 1", asked);
    phases[number] = phase;
  }
  return phases;
}

std::size_t Motion::number_of(const std::string& mode, const std::string& asked) const {
  const auto found =
      std::find_if(modes_.begin(), modes_.end(), [&](const MotionMode& one) { return one.name == mode; });
  if (found != modes_.end()) return static_cast<std::size_t>(found - modes_.begin());
  std::vector<std::string> names;
  for (const MotionMode& one : modes_) names.push_back(one.name);
  refuse_mode(asked, name_, names);
}

void refuse_mode(const std::string& asked, const std::string& body, const std::vector<std::string>& names) {
  throw InputError("{}: {} has no such mode; choose one of {}", asked, body, fmt::join(names, ", "));
}

HeldMotion Motion::held_at(std::span<const double> phases) const {
  std::vector<std::vector<HeldMotion::Part>> held;
  for (std::size_t m = 0; m < modes_.size(); ++m)
    if (auto parts = parts_of(modes_[m], phases[m]); !parts.empty()) held.push_back(std::move(parts));
  return HeldMotion(std::move(held));
}

HeldMotion Motion::mode_held_at(std::size_t mode, double phase) const {
  auto parts = parts_of(modes_[mode], phase);
  return parts.empty() ? HeldMotion() : HeldMotion({std::move(parts)});
}

}  // namespace xraycast
