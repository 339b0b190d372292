#include "options/motion_options.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/named_number.hpp"

#include <fmt/format.h>

#include <memory>

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

void add_instant_options(CLI::App& command, MotionOptions& options) {
  CLI::Option* phase =
      command
          .add_option(
              "--phase", options.phases,
              "Of a map that moves, or of --motion: the phase, 0 to 1, at which a mode is held; the others "
              "are at 0. Repeat it for several modes")
          ->allow_extra_args(false)
          ->type_name("NAME=0..1");
  command.add_option("--time", options.time_s, "Instead: the phases of all modes at a time in seconds")
      ->excludes(phase)
      ->type_name("S");
}

void add_body_options(CLI::App& command, BodyOptions& options, const std::string& motion, bool needs_motion) {
  CLI::Option* file = command.add_option("--motion", options.motion, motion)->type_name("FILE");
  CLI::Option* phase =
      command
          .add_option(
              "--phase", options.phases,
              "A mode of the motion that is held, and its phase, 0 to 1; the others go on. Repeat it for "
              "several modes")
          ->allow_extra_args(false)
          ->type_name("NAME=0..1");
  CLI::Option* gate =
      command
          .add_option(
              "--gate", options.gate,
              "Exposures wait for this phase of a mode, as by an ECG trigger: heart=0.75 is late in the "
              "beat, when the heart rests")
          ->type_name("NAME=0..1");
  CLI::Option* speed = command
                           .add_option("--motion-speed", options.speed,
                                       "How fast the body moves: 2 breathes and beats twice as fast")
                           ->capture_default_str()
                           ->type_name("FACTOR");
  if (needs_motion)
    for (CLI::Option* option : {phase, gate, speed}) option->needs(file);
}

BodyRequest body_request_of(const BodyOptions& options) {
  BodyRequest request{.phase = parse_phases(options.phases), .speed = options.speed};
  if (!options.gate.empty()) request.gate = parse_gate(options.gate);
  if (!options.motion.empty()) request.motion = std::make_shared<const Motion>(read_motion(options.motion));
  return request;
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

std::map<std::string, int> parse_keys(const std::vector<std::string>& texts) {
  std::map<std::string, int> keys;
  for (const std::string& text : texts) {
    const auto key = parse_named_number<int>(text);
    if (!key)
      throw InputError("--keys {}: must be a mode and the number of its key phases, such as breath=4",
                       excerpt(text));
    if (!keys.insert(*key).second)
      throw InputError("--keys {}: {} is given twice; leave one of them out", text, key->first);
  }
  return keys;
}

MotionRequest motion_request_of(const MotionOptions& options) {
  return {options.motion, parse_phases(options.phases), options.time_s};
}

MotionRequest parse_motion(const MotionOptions& options) {
  MotionRequest request = motion_request_of(options);
  check(request);
  return request;
}

Json to_json(const KeyPhases& phases) {
  Json modes = Json::array();
  for (std::size_t m = 0; m < phases.phases().size(); ++m)
    modes.push_back({{"name", phases.rhythm().modes()[m].name}, {"phases", phases.phases()[m]}});
  return modes;
}

Json to_json(const MotionOfRequest& motion) {
  Json json = Json::object();
  for (const auto& [mode, phase] : motion.phases) json[mode] = phase;
  return json;
}

}  // namespace xraycast::cli
