#pragma once

#include "xraycast/acquisition/mask_phase.hpp"
#include "xraycast/contrast_agent/injection.hpp"
#include "xraycast/fluoroscope/subtraction.hpp"

#include <CLI/CLI.hpp>

#include <optional>
#include <string>

namespace xraycast::cli {

/// --inject, --injection-rate, --injection-volume, --iodine and --particles, as given.
struct InjectionOptions {
  std::string times;
  double rate_ml_s = Injection{}.rate_ml_s, iodine_mg_ml = Injection{}.agent_mg_ml;
  std::optional<double> volume_ml;
  double particles_mm = 0;
};

void add_injection_options(CLI::App& command, InjectionOptions& options);

/// None, of no duration, where --inject was not given. Throws InputError.
Injection parse_injection(const InjectionOptions& options);

/// --mask-shift, --dsa-black and --max-opacification, as given.
struct SubtractionOptions {
  std::string mask_shift, mask_phase;
  std::optional<double> black;
  bool shows_maximum_opacification = false;
};

void add_subtraction_options(CLI::App& command, SubtractionOptions& options);

/// --mask-phase alone.
void add_mask_phase_option(CLI::App& command, SubtractionOptions& options);

/// RIGHT,DOWN; no shift for an empty text. Throws InputError.
PixelShift parse_mask_shift(const SubtractionOptions& options);

/// --dsa-black. Throws InputError.
std::optional<double> parse_black(const SubtractionOptions& options);

/// --mask-phase, given in a body that moves by that motion; none where it was not given. Throws InputError,
/// also for a null motion.
std::optional<MaskMatching> matching_of(const SubtractionOptions& options, const Motion* motion);

/// Throws InputError for an option that does not apply: to another look than dsa, or to a file that holds
/// what is not yet subtracted.
void check_subtraction(const SubtractionOptions& options, bool subtracts, const std::string& file);

}  // namespace xraycast::cli
