#pragma once

#include "options/command.hpp"
#include "xraycast/motion/motion_request.hpp"

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

/// `NAME=0..1` of modes, each once. Throws InputError naming --phase.
std::map<std::string, double> parse_phases(const std::vector<std::string>& texts);

/// Throws InputError as check().
MotionRequest parse_motion(const MotionOptions& options);

/// {"breath": 0.3, "heart": 0}, the phases of the motion's modes.
Json to_json(const MotionOfRequest& motion);

}  // namespace xraycast::cli
