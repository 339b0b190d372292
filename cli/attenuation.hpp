#pragma once

#include "options/command.hpp"
#include "xraycast/casting/spectral_scan.hpp"

#include <string>
#include <variant>

namespace xraycast::cli {

/// --opacity and --iodine, as given.
struct AttenuationOptions {
  std::string opacity = "paper", iodine;
};

void add_attenuation_options(CLI::App& command, AttenuationOptions& options);

/// The opacity or spectrum that the options choose. Throws InputError when they contradict each other.
std::variant<Opacity, Spectrum> resolve(const AttenuationOptions& options);

/// Says what to check in the voxels of a scan that was read, and suggests `subtracted` where none is below
/// water.
void say_about_values(const std::variant<Opacity, Spectrum>& attenuation, const SliceSource& voxels,
                      const Session& session);

/// Reads a scan into the device, with the iodine separated when --iodine gives a mask.
SpectralScan load(ComputeDevice& device, const Scan& scan, const AttenuationOptions& options,
                  OutlineFinder& finder, LoadTimings& timings, Progress& progress);

}  // namespace xraycast::cli
