#include "xraycast/acquisition/mask_phase.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/named_number.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

/// Of a waveform, the mean of its cycles; one that goes there and back is over as a whole.
double cycle_of(const MotionMode& mode) {
  if (mode.waveform.empty()) return mode.period_s;
  const double span_s = mode.waveform.back().time_s - mode.waveform.front().time_s;
  const double turns = std::round(std::abs(mode.waveform.back().phase - mode.waveform.front().phase));
  return span_s / std::max(1.0, mode.wraps() ? turns : 1.0);
}

}  // namespace

MaskPhase parse_mask_phase(const std::string& text) {
  if (text == "matched") return {};
  auto fixed = parse_named_number<double>(text);
  if (!fixed)
    throw InputError("`mask_phase` {}: must be matched, or a mode and its phase, such as heart=0.75",
                     excerpt(text));
  return {PhaseGate{std::move(fixed->first), fixed->second}};
}

MaskMatching matching_of(const MaskPhase& wanted, const Motion& motion) {
  const auto& modes = motion.modes();
  std::size_t number = 0;
  if (wanted.fixed) {
    number = motion.number_of(
        wanted.fixed->mode,
        fmt::format("`mask_phase` {}={:g}", excerpt(wanted.fixed->mode), wanted.fixed->phase));
  } else if (const auto heart = std::find_if(modes.begin(), modes.end(),
                                             [](const MotionMode& mode) { return mode.name == "heart"; });
             heart != modes.end()) {
    number = static_cast<std::size_t>(heart - modes.begin());
  }
  const MotionMode& mode = modes[number];
  MaskMatching matching{.mode = number, .wraps = mode.wraps(), .cycle_s = cycle_of(mode)};
  if (!wanted.fixed) return matching;
  matching.phase = wanted.fixed->phase;
  if (!(*matching.phase >= 0 && *matching.phase <= 1))
    throw InputError("`mask_phase` {}={:g}: the phase must be 0 to 1", mode.name, *matching.phase);
  return matching;
}

}  // namespace xraycast
