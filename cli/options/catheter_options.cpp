#include "options/catheter_options.hpp"

#include "options/command.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/negative_zero.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <system_error>

namespace xraycast::cli {
namespace {

/// What --entry takes to choose an end. A branch with two ends is chosen at its start.
std::string choice_of(const VesselTree& tree, const VesselEnd& end) {
  if (end.at_start || end.branch != tree.root()) return fmt::format("--entry {}", end.branch);
  const auto mm = [&](int axis) { return no_negative_zero(end.position_mm[axis], 0); };
  return fmt::format("--entry {:.0f},{:.0f},{:.0f}", mm(0), mm(1), mm(2));
}

/// What is wrong with a --device-model that lists several, or nothing.
std::string check_one_model(const std::string& name) {
  std::error_code error;
  if (name.find(',') == std::string::npos || std::filesystem::exists(name, error)) return "";
  std::string each = name;
  for (std::size_t at = 0; (at = each.find(',', at)) != std::string::npos;)
    each.replace(at, 1, " --device-model ");
  return fmt::format("{}: one device an option; give --device-model {}", name, each);
}

}  // namespace

void add_coaxial_options(CLI::App& command, std::vector<std::string>& instrument_models, std::string& entry) {
  CLI::Option* models = command.add_option(
      "--device-model", instrument_models,
      fmt::format(
          "The instrument: {}, or FILE.json; repeat it for a wire in a catheter, the outermost device "
          "first",
          fmt::join(InstrumentModel::preset_names(), ", ")));
  models->type_name("NAME")->allow_extra_args(false)->check(check_one_model);
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
  std::vector<double> numbers;
  try {
    numbers = parse_numbers(text, "--entry");
  } catch (const InputError&) {  // a word: said below what it must be
  }
  if (numbers.size() == 3) return {glm::dvec3(numbers[0], numbers[1], numbers[2]), name};
  if (numbers.size() != 1 || numbers[0] != std::floor(numbers[0]) ||
      std::abs(numbers[0]) > std::numeric_limits<int>::max())
    throw InputError(
        "{}: must be a branch's number, as in the report.png of `xraycast segment`, or X,Y,Z in mm (LPS)",
        name);
  return {static_cast<int>(numbers[0]), name};
}

std::string text_of(const VesselTree& tree, const VesselEnd& end) {
  const std::string_view side = side_of_patient(tree, end);
  const auto mm = [&](int axis) { return no_negative_zero(end.position_mm[axis], 1); };
  return fmt::format("branch {} at ({:.1f}, {:.1f}, {:.1f}) mm{}{}", end.branch, mm(0), mm(1), mm(2),
                     side.empty() ? "" : ", on the patient's ", side);
}

std::vector<std::string> notes_on_entry(const VesselTree& tree, const EntryChoice& choice,
                                        const VesselEnd& entry, const InstrumentModel& instrument) {
  if (!std::holds_alternative<std::monostate>(choice.end)) return {};
  constexpr std::size_t kMostNamed = 3;
  std::vector<VesselEnd> others = equally_low_ends(tree, entry, instrument);
  if (others.empty()) return {};
  if (others.size() > kMostNamed) others.resize(kMostNamed);
  std::string names, choices = choice_of(tree, entry);
  for (const VesselEnd& other : others) {
    names += fmt::format("{}{}", names.empty() ? "" : "; or ", text_of(tree, other));
    choices += " or " + choice_of(tree, other);
  }
  return {
      fmt::format("vessel ends lie equally low, within {:g} mm: the device enters at {}, and not at {}; "
                  "choose by {}",
                  kEquallyLow_mm, text_of(tree, entry), names, choices)};
}

}  // namespace xraycast::cli
