#include "xraycast/motion/motion_request.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/named_number.hpp"
#include "xraycast/motion/moved_scan.hpp"

#include <cmath>
#include <utility>

namespace xraycast {

void check(const MotionRequest& request) {
  if (!request.is_given()) return;
  if (request.motion.empty())
    throw InputError("`{}` needs a motion; give `motion` too", request.time_s ? "time" : "phase");
  if (request.time_s && !request.phase.empty())
    throw InputError("`phase` and `time` name two instants; give only one of them");
  if (!request.time_s && request.phase.empty())
    throw InputError("`motion` {}: at which instant? Give `phase` or `time`; a phase of 0 is the scan itself",
                     request.motion.string());
  constexpr double kLongest_s = 1e9;
  if (request.time_s && !(std::abs(*request.time_s) <= kLongest_s))
    throw InputError("`time` {}: must be seconds, within {:g}", *request.time_s, kLongest_s);
}

std::vector<double> phases_of(const Motion& motion, const MotionRequest& request) {
  return request.time_s ? motion.phases_at(*request.time_s) : motion.phases_of(request.phase);
}

MotionOfRequest held_motion(const MotionRequest& request) {
  check(request);
  if (!request.is_given()) return {};
  const Motion motion = read_motion(request.motion);
  const std::vector<double> phases = phases_of(motion, request);
  MotionOfRequest of_request{motion.held_at(phases), motion.name(), {}, motion.warnings()};
  for (std::size_t m = 0; m < phases.size(); ++m)
    of_request.phases.emplace_back(motion.modes()[m].name, phases[m]);
  return of_request;
}

std::string MotionOfRequest::suffix() const {
  std::string words;
  for (const auto& [mode, phase] : phases) words += fmt::format(", {} {:.3g}", mode, phase);
  return words;
}

Scan moved(Scan scan, const MotionOfRequest& motion, Progress& progress) {
  scan = moved(std::move(scan), motion.held, motion.name, progress);
  scan.info.warnings.insert(scan.info.warnings.end(), motion.warnings.begin(), motion.warnings.end());
  return scan;
}

std::pair<std::string, double> parse_phase(const std::string& text) {
  auto phase = parse_named_number<double>(text);
  if (!phase) throw InputError("`phase` {}: must be a mode and its phase, such as breath=0.3", excerpt(text));
  return *std::move(phase);
}

}  // namespace xraycast
