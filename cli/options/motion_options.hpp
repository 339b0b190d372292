#pragma once

#include "options/command.hpp"
#include "xraycast/motion/body_request.hpp"
#include "xraycast/motion/key_phases.hpp"
#include "xraycast/motion/motion_request.hpp"

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace xraycast::cli {

/// --motion, --phase and --time, as given.
struct MotionOptions {
  std::string motion;
  std::vector<std::string> phases;
  std::optional<double> time_s;
};

/// `taken` says in their help what is taken at that instant.
void add_motion_options(CLI::App& command, MotionOptions& options,
                        const std::string& taken = "the moved scan is taken");

/// --phase and --time of a map that moves.
void add_instant_options(CLI::App& command, MotionOptions& options);

/// --motion, --phase, --gate and --motion-speed of a body that moves while time passes, as given.
struct BodyOptions {
  std::string motion{};
  std::vector<std::string> phases{};
  std::string gate{};
  double speed = 1;
};

/// `motion` is the help of --motion; the others may be given without it where a map names its motion.
void add_body_options(CLI::App& command, BodyOptions& options, const std::string& motion, bool needs_motion);

/// Reads the motion; not checked yet. Throws InputError.
BodyRequest body_request_of(const BodyOptions& options);

/// `NAME=0..1` of modes, each once. Throws InputError naming --phase.
std::map<std::string, double> parse_phases(const std::vector<std::string>& texts);

/// As given; `parse_motion` throws InputError as check() too.
MotionRequest motion_request_of(const MotionOptions& options);
MotionRequest parse_motion(const MotionOptions& options);

/// `NAME=N` of modes, each once: the numbers of their key phases. Throws InputError naming --keys.
std::map<std::string, int> parse_keys(const std::vector<std::string>& texts);

/// The modes of a map that moves, and their key phases: [{"name", "phases"}].
Json to_json(const KeyPhases& phases);

/// {"breath": 0.3, "heart": 0}, the phases of the motion's modes.
Json to_json(const MotionOfRequest& motion);

}  // namespace xraycast::cli
