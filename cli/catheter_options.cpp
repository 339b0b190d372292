#include "catheter_options.hpp"

#include "xraycast/mechanics/instrument_model.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace xraycast::cli {

void add_catheter_options(CLI::App& command, std::string& instrument_model, std::string& entry) {
  CLI::Option* model = command
                           .add_option("--device-model", instrument_model,
                                       fmt::format("The instrument: {}, or FILE.json",
                                                   fmt::join(InstrumentModel::preset_names(), ", ")))
                           ->type_name("NAME");
  if (instrument_model.empty())
    model->required();
  else
    model->capture_default_str();
  command
      .add_option(
          "--entry", entry,
          "Vessel end at which it enters: the number of a branch, or the end nearest to a point in LPS mm "
          "(default: the most inferior end that it fits into)")
      ->type_name("BRANCH|X,Y,Z");
}

}  // namespace xraycast::cli
