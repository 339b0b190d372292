#include "catheter_options.hpp"

#include "command.hpp"
#include "xraycast/base/error.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <limits>

namespace xraycast::cli {

namespace {

void add_entry(CLI::App& command, std::string& entry) {
  command
      .add_option("--entry", entry,
                  "Vessel end at which the device enters: the number of a branch, or the end nearest to a "
                  "point in mm (LPS) (default: the most inferior end that the device fits into)")
      ->type_name("BRANCH|X,Y,Z");
}

std::string instruments() {
  return fmt::format("{}, or FILE.json", fmt::join(InstrumentModel::preset_names(), ", "));
}

}  // namespace

void add_catheter_options(CLI::App& command, std::string& instrument_model, std::string& entry) {
  CLI::Option* model =
      command
          .add_option("--device-model", instrument_model, fmt::format("The instrument: {}", instruments()))
          ->type_name("NAME");
  if (instrument_model.empty())
    model->required();
  else
    model->capture_default_str();
  add_entry(command, entry);
}

void add_coaxial_options(CLI::App& command, std::vector<std::string>& instrument_models, std::string& entry) {
  command
      .add_option("--device-model", instrument_models,
                  fmt::format("The instrument: {}; repeated for a wire in a catheter, the outermost first",
                              instruments()))
      ->required()
      ->allow_extra_args(false)
      ->type_name("NAME");
  add_entry(command, entry);
}

EntryChoice parse_entry(const std::string& text) {
  if (text.empty()) return {};
  const std::string name = "--entry " + text;
  const std::vector<double> numbers = parse_numbers(text, "--entry");
  if (numbers.size() == 3) return {glm::dvec3(numbers[0], numbers[1], numbers[2]), name};
  if (numbers.size() != 1 || numbers[0] != std::floor(numbers[0]) ||
      std::abs(numbers[0]) > std::numeric_limits<int>::max())
    throw InputError("{}: must be a branch's number or X,Y,Z in mm (LPS)", name);
  return {static_cast<int>(numbers[0]), name};
}

}  // namespace xraycast::cli
