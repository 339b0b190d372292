#pragma once

#include "xraycast/blood_flow/blood.hpp"

#include <CLI/CLI.hpp>

#include <string>

namespace xraycast::cli {

/// --heart-rate and --heart-waveform, as given.
struct HeartOptions {
  double rate_bpm = Blood{}.heart_rate_bpm;
  std::string waveform;
};

void add_heart_options(CLI::App& command, HeartOptions& options);

/// The blood of a body with that heart. Throws InputError for a file that cannot be read.
Blood parse_heart(const HeartOptions& options);

}  // namespace xraycast::cli
