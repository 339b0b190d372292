#pragma once

#include "command.hpp"
#include "xraycast/casting/spectral_scan.hpp"

#include <string>
#include <variant>

namespace xraycast::cli {

/// --opacity and --iodine, as given.
struct AttenuationOptions {
  std::string opacity = "paper", iodine;
};

void add_attenuation_options(CLI::App& command, AttenuationOptions& options);

/// What they say. Throws InputError when they do not go together.
std::variant<Opacity, Spectrum> resolve(const AttenuationOptions& options);

/// Where paper takes all of a scan for matter, as of a subtracted angiogram.
void hint_at_opacity(const std::variant<Opacity, Spectrum>& attenuation, const SliceSource::HuRange& hu,
                     const Session& session);

/// Reads a scan into the device, with its contrast apart when --iodine names the vessels.
SpectralScan load(ComputeDevice& device, const Scan& scan, const AttenuationOptions& options,
                  OutlineFinder& finder, LoadTimings& timings, Progress& progress);

}  // namespace xraycast::cli
