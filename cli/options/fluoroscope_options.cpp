#include "options/fluoroscope_options.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace xraycast::cli {
namespace {

template <typename Value>
CLI::Option* add(CLI::App& command, const char* name, Value& value, const std::string& help,
                 const char* type) {
  return command.add_option(name, value, help)->type_name(type)->group("Fluoroscope");
}

void add_c_arm_option(CLI::App& command, FluoroscopeRequest& request, const char* sets) {
  add(command, "--c-arm", request.c_arm,
      fmt::format("C-arm with its distances, detector, tube and table: {}, or a file; sets {}",
                  fmt::join(CArm::preset_names(), ", "), sets),
      "NAME|FILE.json");
}

void add_dose_option(CLI::App& command, FluoroscopeRequest& request, const std::string& effect) {
  add(command, "--dose", request.dose,
      "Detector dose per pulse: low or normal (default) for fluoroscopy, cine for a recorded run" + effect,
      "NAME")
      ->check(CLI::IsMember({"low", "normal", "cine"}));
}

void add_rate_option(CLI::App& command, FluoroscopeRequest& request) {
  add(command, "--pulse-rate", request.pulse_rate, "Pulses per second, 3 to 30 (default 15)", "HZ");
}

void add_compression_option(CLI::App& command, FluoroscopeRequest& request) {
  add(command, "--compression", request.compression,
      "How much of what is large and strong in the picture the display takes back, 0 to 1, so that lung and "
      "spine are seen at once. Default: the C-arm's, 0.6 in presets with a flat panel and 0.3 with an "
      "intensifier; 0 is a grey window of fixed width",
      "SHARE");
}

void add_seed_option(CLI::App& command, FluoroscopeRequest& request) {
  add(command, "--seed", request.seed, "Seed of the noise (default 1): the same seed gives the same file",
      "N");
}

}  // namespace

void add_fluoroscope_options(CLI::App& command, FluoroscopeArguments& options) {
  FluoroscopeRequest& request = options.request;
  add_c_arm_option(command, request, "--cone, --size and --pixel unless they are given");
  add(command, "--field", request.field_mm,
      "Field of view (magnification mode): its side on the detector; default: the largest", "MM");
  add(command, "--collimate", options.collimate,
      "Collimator opening, width and height at the detector, and its rotation", "MM,MM[,DEG]");
  add_dose_option(command, request,
                  "; any option of this group adds the noise, blur and dose of a fluoroscope");
  add(command, "--kvp", request.kvp, "Tube voltage; the automatic exposure control then sets only the mAs",
      "KVP");
  add(command, "--mas", request.mas,
      "mAs per pulse; the automatic exposure control then sets only the voltage", "MAS");
  add(command, "--photons", request.photons,
      "Photons detected per pixel of the unattenuated field, instead of an exposure", "N");
  add_rate_option(command, request);
  add_compression_option(command, request);
  add(command, "--stages", request.stages,
      "Stages to simulate: a list of quanta, blur, lag, electronics, scatter and display, or none (default: "
      "all)",
      "LIST");
  add_seed_option(command, request);
}

void add_page_fluoroscope_options(CLI::App& command, FluoroscopeRequest& request) {
  add_c_arm_option(command, request, "the page's cone and, at first, its field, unless a session does");
  add_dose_option(command, request, ", at first");
  add_rate_option(command, request);
  add_compression_option(command, request);
  add_seed_option(command, request);
}

std::optional<FluoroscopyOptions> parse_fluoroscope(const FluoroscopeArguments& options) {
  FluoroscopeRequest request = options.request;
  if (!options.collimate.empty()) request.collimate = parse_numbers(options.collimate, "--collimate");
  if (request == FluoroscopeRequest{}) return std::nullopt;
  return options_of(request);
}

void note_on_energies(const Invocation& invocation) {
  invocation.say(
      {"optical depths hold one energy only: the fluoroscope treats the body as water of the same optical "
       "depth; for beam hardening in bone, project the scan with --opacity spectrum:KVP"});
}

void check_linear_codes(const DicomOptions& dicom) {
  if (dicom.intensity == "log")
    throw InputError("--intensity log: the detector values of a fluoroscope are linear; leave it out");
}

void note_on_saturation(bool is_saturated, const Invocation& invocation) {
  if (is_saturated)
    invocation.say(
        {"the middle of the picture saturates the detector: lower --mas or --kvp, or leave them to the "
         "exposure control"});
}

GreyDisplay display_of(const GreyOptions& grey) { return {grey.gamma.value_or(1), grey.inverted}; }

Json to_json(const ExposureRecord& exposure) {
  const DoseRecord& dose = exposure.dose;
  return {{"c_arm", exposure.c_arm},       {"kvp", exposure.technique.kvp},
          {"mas", exposure.technique.mas}, {"air_kerma_mGy", dose.air_kerma_mGy},
          {"dap_Gycm2", dose.dap_Gycm2},   {"fluoroscopy_s", dose.fluoroscopy_s},
          {"pulses", dose.pulses},         {"images", dose.images}};
}

std::string summary(const ExposureRecord& exposure) {
  const DoseRecord& dose = exposure.dose;
  if (!exposure.has_dose)
    return fmt::format("{}: {}, {} recorded; the photons were given, so there is no air kerma or dose\n",
                       exposure.c_arm, pluralize(dose.pulses, "pulse"), pluralize(dose.images, "image"));
  return fmt::format(
      "{}: {} kVp, {:.3g} mAs per pulse; {}, {:.2f} s of fluoroscopy, {} recorded, air kerma {:.3g} mGy at "
      "the "
      "reference point, dose-area product {:.3g} Gy cm2\n",
      exposure.c_arm, exposure.technique.kvp, exposure.technique.mas, pluralize(dose.pulses, "pulse"),
      dose.fluoroscopy_s, pluralize(dose.images, "image"), dose.air_kerma_mGy, dose.dap_Gycm2);
}

}  // namespace xraycast::cli
