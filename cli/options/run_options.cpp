#include "options/run_options.hpp"

#include "options/command.hpp"
#include "xraycast/base/error.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <system_error>

namespace xraycast::cli {
namespace {

/// What is wrong with a --device-model that lists several, or nothing.
std::string check_one_model(const std::string& name) {
  std::error_code error;
  if (name.find(',') == std::string::npos || std::filesystem::exists(name, error)) return "";
  std::string each = name;
  for (std::size_t at = 0; (at = each.find(',', at)) != std::string::npos;)
    each.replace(at, 1, " --device-model ");
  return fmt::format("{}: one instrument an option; give --device-model {}", name, each);
}

EntryChoice parse_entry(const std::string& text) {
  if (text.empty()) return {};
  const std::string name = "--entry " + text;
  std::vector<double> numbers;
  try {
    numbers = parse_numbers(text, "--entry");
  } catch (const InputError&) {  // a name
  }
  if (numbers.size() == 3) return {glm::dvec3(numbers[0], numbers[1], numbers[2]), name};
  if (numbers.empty()) return {text, name};
  if (numbers.size() != 1 || numbers[0] != std::floor(numbers[0]) ||
      std::abs(numbers[0]) > std::numeric_limits<int>::max())
    throw InputError(
        "{}: must be a branch's number or name, as in the report.png of `xraycast segment`, or X,Y,Z in mm "
        "(LPS)",
        name);
  return {static_cast<int>(numbers[0]), name};
}

}  // namespace

void add_coaxial_options(CLI::App& command, RunOptions& options) {
  std::vector<std::string>& instrument_models = options.instrument_models;
  CLI::Option* models = command.add_option(
      "--device-model", instrument_models,
      fmt::format(
          "The instrument: {}, or FILE.json; repeat it for a wire in a catheter, the outermost instrument "
          "first",
          fmt::join(InstrumentModel::preset_names(), ", ")));
  models->type_name("NAME")->allow_extra_args(false)->check(check_one_model);
  instrument_models.empty() ? models->required()
                            : models->default_str(fmt::format("{}", fmt::join(instrument_models, ", ")));
  command
      .add_option(
          "--entry", options.entry,
          "Vessel end where the instrument enters (the puncture site): a branch's number or its vessel's "
          "name, such as \"right external iliac artery\", or the end nearest to a point in mm (LPS) "
          "(default: the most inferior end that the instrument fits into)")
      ->type_name("BRANCH|NAME|X,Y,Z");
}

CLI::Option* add_script_option(CLI::App& command, RunOptions& options, const std::string& purpose) {
  return command.add_option("--script", options.script, purpose)->type_name("CSV");
}

RunRequest parse_run(const RunOptions& options, const std::filesystem::path& vessels) {
  RunRequest request{.instruments = instruments_named(options.instrument_models),
                     .entry = parse_entry(options.entry)};
  check_instruments(request.instruments);  // before a script is read that may be for others
  if (!options.script.empty()) request.script = Script::read(options.script, request.instruments.size());
  request.tree = std::make_shared<const VesselTree>(read_tree(vessels));
  request.body = body_request_of(options.body);
  return request;
}

}  // namespace xraycast::cli
