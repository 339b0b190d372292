#include "options/fluoroscope_options.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/casting/projection_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace xraycast::cli {
namespace {

constexpr const char* kUsualC_arm = "fixed-single-plane";
constexpr const char* kFluoroscopeGroup = "Fluoroscope";

Collimation parse_collimation(const std::string& text) {
  const std::vector<double> numbers = parse_numbers(text, "--collimate");
  if (numbers.size() < 2 || numbers.size() > 3)
    throw InputError("--collimate {}: must be WIDTH,HEIGHT in mm on the detector, or WIDTH,HEIGHT,DEG", text);
  const double turn_deg = numbers.size() > 2 ? numbers[2] : 0;
  return {numbers[0], numbers[1], turn_deg * std::numbers::pi / 180};
}

DoseLevel parse_dose(const std::string& name) {
  return name == "low" ? DoseLevel::low : name == "cine" ? DoseLevel::cine : DoseLevel::normal;
}

}  // namespace

void add_fluoroscope_options(CLI::App& command, FluoroscopeArguments& options) {
  const auto add = [&command](const char* name, auto& value, const std::string& help, const char* type) {
    return command.add_option(name, value, help)->type_name(type)->group(kFluoroscopeGroup);
  };
  add("--c-arm", options.c_arm,
      fmt::format(
          "C-arm with its distances, detector, tube and table: {}, or a file; sets --cone, --size and "
          "--pixel unless they are given",
          fmt::join(CArm::preset_names(), ", ")),
      "NAME|FILE.json");
  add("--field", options.field_mm,
      "Field of view (magnification mode): its side on the detector; default: the largest", "MM");
  add("--collimate", options.collimate,
      "Collimator opening, width and height at the detector, and its rotation", "MM,MM[,DEG]");
  add("--dose", options.dose,
      "Detector dose per pulse: low or normal (default) for fluoroscopy, cine for a recorded run; any option "
      "of "
      "this group adds the noise, blur and dose of a fluoroscope",
      "NAME")
      ->check(CLI::IsMember({"low", "normal", "cine"}));
  add("--kvp", options.kvp, "Tube voltage; the automatic exposure control then sets only the mAs", "KVP");
  add("--mas", options.mas, "mAs per pulse; the automatic exposure control then sets only the voltage",
      "MAS");
  add("--photons", options.photons,
      "Photons detected per pixel of the unattenuated field, instead of an exposure", "N");
  add("--pulse-rate", options.pulses_per_s, "Pulses per second, 3 to 30 (default 15)", "HZ");
  add("--stages", options.stages,
      "Stages to simulate: a list of quanta, blur, lag, electronics, scatter and display, or none (default: "
      "all)",
      "LIST");
  add("--seed", options.seed, "Seed of the noise (default 1): the same seed gives the same file", "N");
}

std::optional<FluoroscopyOptions> parse_fluoroscope(const FluoroscopeArguments& options) {
  const bool is_given = !options.c_arm.empty() || !options.collimate.empty() || !options.dose.empty() ||
                        !options.stages.empty() || options.field_mm || options.mas || options.photons ||
                        options.pulses_per_s || options.kvp || options.seed;
  if (!is_given) return std::nullopt;
  FluoroscopyOptions parsed;
  parsed.c_arm = CArm::named(options.c_arm.empty() ? kUsualC_arm : options.c_arm);
  if (options.field_mm && options.c_arm.empty())
    throw InputError("--field {:g}: is a field of a C-arm; add --c-arm NAME", *options.field_mm);
  if (!options.c_arm.empty()) parsed.field_mm = zoom_field_mm(parsed.c_arm, options.field_mm);
  if (!options.collimate.empty()) parsed.collimation = parse_collimation(options.collimate);
  parsed.dose = parse_dose(options.dose);
  parsed.kvp = options.kvp;
  parsed.mas = options.mas;
  parsed.photons = options.photons;
  if (options.pulses_per_s) parsed.pulses_per_s = *options.pulses_per_s;
  if (!options.stages.empty()) parsed.stages = FluoroscopyStages::from_list(options.stages);
  if (options.seed) parsed.seed = *options.seed;
  check(parsed);
  return parsed;
}

std::optional<int> tube_kvp(const std::string& opacity, const std::variant<Opacity, Spectrum>& attenuation) {
  const auto* spectrum = std::get_if<Spectrum>(&attenuation);
  const std::string name = opacity.substr(opacity.find(':') + 1);
  if (!spectrum || spectrum->name() != name + " kVp") return std::nullopt;
  return std::stoi(name);
}

void use_spectrum(const std::string& opacity, const std::variant<Opacity, Spectrum>& attenuation,
                  FluoroscopyOptions& fluoroscopy) {
  const auto* spectrum = std::get_if<Spectrum>(&attenuation);
  if (!spectrum) return;
  const std::optional<int> kvp = tube_kvp(opacity, attenuation);
  const bool is_file = !kvp;
  if (is_file && fluoroscopy.kvp)
    throw InputError("--kvp {} with --opacity {}: both set the tube voltage; leave one of them out",
                     *fluoroscopy.kvp, opacity);
  if (is_file)
    fluoroscopy.spectrum = *spectrum;
  else if (!fluoroscopy.kvp)
    fluoroscopy.kvp = kvp;
  check(fluoroscopy);
}

View on_c_arm(const FluoroscopeArguments& options, const std::optional<FluoroscopyOptions>& fluoroscopy,
              const View& view) {
  return options.c_arm.empty() ? view : view_of(fluoroscopy->c_arm, fluoroscopy->field_mm, view);
}

void note_on_energies(const Session& session) {
  session.say(
      {"optical depths hold one energy only: the fluoroscope treats the body as water of the same optical "
       "depth; for beam hardening in bone, project the scan with --opacity spectrum:KVP"});
}

void check_linear_codes(const DicomOptions& dicom) {
  if (dicom.intensity == "log")
    throw InputError("--intensity log: the detector values of a fluoroscope are linear; leave it out");
}

void check_fluoroscopy(ShadingMode shading, const DicomOptions& dicom) {
  check_linear_codes(dicom);
  if (shading != ShadingMode::fluoro)
    throw InputError("--look surface: a fluoroscope cannot show shaded surfaces; leave it out");
}

void note_on_saturation(bool is_saturated, const Session& session) {
  if (is_saturated)
    session.say(
        {"the middle of the picture saturates the detector: lower --mas or --kvp, or leave them to the "
         "exposure control"});
}

std::vector<std::uint8_t> displayed(std::vector<std::uint8_t> greys, const GreyOptions& grey) {
  const double gamma = grey.gamma.value_or(1);
  constexpr int kWhite = 255;
  std::array<std::uint8_t, kWhite + 1> shown{};
  for (int value = 0; value <= kWhite; ++value) {
    const double bent = std::pow(1.0 * value / kWhite, 1 / gamma);
    shown[static_cast<std::size_t>(value)] =
        static_cast<std::uint8_t>(std::lround(kWhite * (grey.inverted ? 1 - bent : bent)));
  }
  for (std::uint8_t& value : greys) value = shown[value];
  return greys;
}

std::optional<XaExposure> exposure_of(const Fluoroscope& fluoroscope, const Technique& technique) {
  if (technique.mas == 0) return std::nullopt;
  return XaExposure{.kvp = 1.0 * technique.kvp,
                    .mas = technique.mas,
                    .pulse_ms = fluoroscope.options().c_arm.tube.pulse_ms,
                    .dap_Gycm2 = fluoroscope.dose().dap_Gycm2,
                    .is_fluoroscopy = fluoroscope.options().dose != DoseLevel::cine};
}

void write_fluoroscopy(const Fluoroscope& fluoroscope, const FluoroscopyFrame& frame, const View& view,
                       const std::string& file, const GreyOptions& grey, XaOptions xa) {
  if (is_picture(file)) return write_picture(displayed(frame.shown, grey), view.width, view.height, 1, file);
  if (!is_xa(file)) return write_detector_signal(view, frame.signal_kev, file);
  xa.code_bits = fluoroscope.bits();
  xa.is_fluoroscopy = fluoroscope.options().dose != DoseLevel::cine;
  XaWriter writer(file, view, 1, std::move(xa));
  writer.add_codes(view, frame.codes);
  if (const auto exposure = exposure_of(fluoroscope, frame.technique)) writer.set_exposure(*exposure);
  writer.finish();
}

Json to_json(const Fluoroscope& fluoroscope, const Technique& technique) {
  const DoseRecord& dose = fluoroscope.dose();
  return {{"c_arm", fluoroscope.options().c_arm.name},
          {"kvp", technique.kvp},
          {"mas", technique.mas},
          {"air_kerma_mGy", dose.air_kerma_mGy},
          {"dap_Gycm2", dose.dap_Gycm2},
          {"fluoroscopy_s", dose.fluoroscopy_s},
          {"pulses", dose.pulses},
          {"images", dose.images}};
}

std::string summary(const Fluoroscope& fluoroscope, const Technique& technique) {
  const DoseRecord& dose = fluoroscope.dose();
  if (technique.mas == 0)
    return fmt::format("{}: {}, {} recorded; the photons were given, so there is no air kerma or dose\n",
                       fluoroscope.options().c_arm.name, pluralize(dose.pulses, "pulse"),
                       pluralize(dose.images, "image"));
  return fmt::format(
      "{}: {} kVp, {:.3g} mAs per pulse; {}, {:.2f} s of fluoroscopy, {} recorded, air kerma {:.3g} mGy at "
      "the "
      "reference point, dose-area product {:.3g} Gy cm2\n",
      fluoroscope.options().c_arm.name, technique.kvp, technique.mas, pluralize(dose.pulses, "pulse"),
      dose.fluoroscopy_s, pluralize(dose.images, "image"), dose.air_kerma_mGy, dose.dap_Gycm2);
}

}  // namespace xraycast::cli
