#include "options/angiography_options.hpp"

#include "options/command.hpp"
#include "options/view_options.hpp"
#include "xraycast/acquisition/run_cine.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/projection/xa_file.hpp"

#include <cmath>
#include <limits>
#include <vector>

namespace xraycast::cli {

void add_injection_options(CLI::App& command, InjectionOptions& options) {
  CLI::Option* inject = command
                            .add_option("--inject", options.times,
                                        "Inject contrast agent at the tip between these times in s; "
                                        "with --injection-volume TO may "
                                        "be left out, as in --inject 8 --injection-rate 6 --injection-volume "
                                        "12; with both the earlier end counts")
                            ->type_name("FROM_S[,TO_S]");
  command.add_option("--injection-rate", options.rate_ml_s, "--inject: flow rate of the injection")
      ->needs(inject)
      ->capture_default_str()
      ->type_name("ML/S");
  command.add_option("--injection-volume", options.volume_ml, "--inject: end after this volume")
      ->needs(inject)
      ->type_name("ML");
  command
      .add_option("--iodine", options.iodine_mg_ml, "--inject: iodine concentration of the contrast agent")
      ->needs(inject)
      ->capture_default_str()
      ->type_name("MG/ML");
  command
      .add_option("--particles", options.particles_mm,
                  "--inject: with particles of this diameter in the agent, 0.1 to 1.2 mm, 6 % of its volume; "
                  "they go with the blood and close the arterioles where they arrive")
      ->needs(inject)
      ->type_name("MM");
}

Injection parse_injection(const InjectionOptions& options) {
  Injection injection{.rate_ml_s = options.rate_ml_s,
                      .agent_mg_ml = options.iodine_mg_ml,
                      .particles = {options.particles_mm}};
  if (!options.times.empty()) {
    const std::vector<double> times_s = parse_numbers(options.times, "--inject");
    const bool is_open = times_s.size() == 1 && options.volume_ml;
    if (!is_open && !(times_s.size() == 2 && times_s[0] < times_s[1]))
      throw InputError("--inject {}: must be FROM,TO in seconds, with FROM below TO{}", options.times,
                       times_s.size() == 1 ? "; or add --injection-volume" : "");
    injection.from_s = times_s.front();
    injection.to_s = is_open ? std::numeric_limits<double>::infinity() : times_s[1];
    if (options.volume_ml) injection.end_after(*options.volume_ml);
  }
  check(injection);
  return injection;
}

void add_mask_phase_option(CLI::App& command, SubtractionOptions& options) {
  command
      .add_option(
          "--mask-phase", options.mask_phase,
          "dsa, in a body that moves: matched, each exposure has the mask of its own phase of the heart; "
          "heart=0.75, all have the mask of that phase. Without it the mask is the mean of its pulses")
      ->type_name("matched|NAME=0..1");
}

void add_subtraction_options(CLI::App& command, SubtractionOptions& options) {
  command
      .add_option("--mask-shift", options.mask_shift,
                  "dsa: pixel shift of the mask before subtraction; fractions are allowed")
      ->type_name("RIGHT,DOWN");
  add_mask_phase_option(command, options);
  command
      .add_option(
          "--dsa-black", options.black,
          "dsa: the optical depth of iodine that is black, for films that are compared. Without it that "
          "across the vessel at the tip, were it healthy, filled as the injection fills it; the result "
          "tells it")
      ->type_name("0.01..10");
  command.add_flag("--max-opacification", options.shows_maximum_opacification,
                   "dsa: every pixel keeps its densest value so far (maximum opacification)");
}

PixelShift parse_mask_shift(const SubtractionOptions& options) {
  if (options.mask_shift.empty()) return {};
  const std::vector<double> pixels = parse_numbers(options.mask_shift, "--mask-shift");
  constexpr double kMost = 1000;
  if (pixels.size() != 2 || !(std::abs(pixels[0]) <= kMost && std::abs(pixels[1]) <= kMost))
    throw InputError("--mask-shift {}: must be RIGHT,DOWN in pixels, up to {:g}", options.mask_shift, kMost);
  return {pixels[0], pixels[1]};
}

std::optional<double> parse_black(const SubtractionOptions& options) {
  constexpr double kLeast = RunCine::kLeastBlack, kMost = RunCine::kMostBlack;
  if (options.black && !(*options.black >= kLeast && *options.black <= kMost))
    throw InputError("--dsa-black {:g}: must be {:g} to {:g}", *options.black, kLeast, kMost);
  return options.black;
}

std::optional<MaskMatching> matching_of(const SubtractionOptions& options, const Motion* motion) {
  if (options.mask_phase.empty()) return std::nullopt;
  const MaskPhase wanted = parse_mask_phase(options.mask_phase);
  if (!motion)
    throw InputError("--mask-phase {}: the body is still; give --motion too, or leave it out",
                     options.mask_phase);
  return matching_of(wanted, *motion);
}

void check_subtraction(const SubtractionOptions& options, bool subtracts, const std::string& file) {
  const auto check = [&](bool is_given, const char* option) {
    if (!is_given) return;
    if (!subtracts) throw InputError("{}: applies only to --look dsa; add that or leave it out", option);
    if (is_xa(file))
      throw InputError("{}: {} holds frames and mask before subtraction; leave it out, or write a .gif",
                       option, file);
  };
  check(!options.mask_shift.empty(), "--mask-shift");
  check(options.black.has_value(), "--dsa-black");
  check(!options.mask_phase.empty(), "--mask-phase");
  check(options.shows_maximum_opacification, "--max-opacification");
}

}  // namespace xraycast::cli
