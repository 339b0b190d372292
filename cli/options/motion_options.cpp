#include "options/motion_options.hpp"

#include "xraycast/base/error.hpp"

#include <fmt/format.h>

namespace xraycast::cli {

void add_motion_options(CLI::App& command, MotionOptions& options, const std::string& taken) {
  CLI::Option* motion = command
                            .add_option("--motion", options.motion,
                                        "How the body moves: a motion.json of displacement fields; " + taken)
                            ->type_name("FILE");
  command
      .add_option("--phase", options.phases,
                  "The phase, 0 to 1, at which a mode of the motion is held; the others are at 0. Repeat it "
                  "for several modes")
      ->needs(motion)
      ->allow_extra_args(false)
      ->type_name("NAME=0..1");
  command.add_option("--time", options.time_s, "Instead: the phases of all modes at a time in seconds")
      ->needs(motion)
      ->type_name("S");
}

std::map<std::string, double> parse_phases(const std::vector<std::string>& texts) {
  std::map<std::string, double> phases;
  for (const std::string& text : texts) {
    const auto phase = parse_phase(text);
    if (!phases.insert(phase).second)
      throw InputError("--phase {}: {} is given twice; leave one of them out", text, phase.first);
  }
  return phases;
}

MotionRequest parse_motion(const MotionOptions& options) {
  MotionRequest request{options.motion, parse_phases(options.phases), options.time_s};
  check(request);
  return request;
}

Json to_json(const MotionOfRequest& motion) {
  Json json = Json::object();
  for (const auto& [mode, phase] : motion.phases) json[mode] = phase;
  return json;
}

}  // namespace xraycast::cli
