#pragma once

#include "command.hpp"
#include "xraycast/attenuation/spectrum.hpp"

#include <string>

namespace xraycast::cli {

/// --opacity and --iodine, as given.
struct AttenuationOptions {
  std::string opacity = "paper", iodine;
};

void add_attenuation_options(CLI::App& command, AttenuationOptions& options);

}  // namespace xraycast::cli
