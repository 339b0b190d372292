#include "catheter_options.hpp"

#include "xraycast/mechanics/instrument_model.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace xraycast::cli {

void add_catheter_options(CLI::App& command, std::string& instrument_model, std::string& entry) {
  CLI::Option* model = command
                           .add_option("--device-model", instrument_model,
                                       fmt::format("What is steered: {}, or FILE.json",
                                                   fmt::join(InstrumentModel::preset_names(), ", ")))
                           ->type_name("NAME");
  if (instrument_model.empty())
    model->required();
  else
    model->capture_default_str();
  command
      .add_option(
          "--entry", entry,
          "The vessel end it enters at: a branch's number, or the one nearest to a point (default: the "
          "most inferior one that it fits into)")
      ->type_name("BRANCH|X,Y,Z");
}

}  // namespace xraycast::cli
