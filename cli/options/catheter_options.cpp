#include "options/catheter_options.hpp"

#include "options/command.hpp"
#include "xraycast/base/error.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <limits>

namespace xraycast::cli {

void add_coaxial_options(CLI::App& command, std::vector<std::string>& instrument_models, std::string& entry) {
  CLI::Option* models = command.add_option(
      "--device-model", instrument_models,
      fmt::format(
          "The instrument: {}, or FILE.json; repeat it for a wire in a catheter, the outermost device "
          "first",
          fmt::join(InstrumentModel::preset_names(), ", ")));
  models->type_name("NAME")->allow_extra_args(false);
  instrument_models.empty() ? models->required()
                            : models->default_str(fmt::format("{}", fmt::join(instrument_models, ", ")));
  command
      .add_option("--entry", entry,
                  "Vessel end where the device enters (the puncture site): the number of a branch, or the "
                  "end nearest to a "
                  "point in mm (LPS) (default: the most inferior end that the device fits into)")
      ->type_name("BRANCH|X,Y,Z");
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
