#pragma once

#include "options/command.hpp"
#include "options/view_options.hpp"
#include "xraycast/fluoroscope/fluoroscope.hpp"
#include "xraycast/scene/scene.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace xraycast::cli {

/// --c-arm, --field, --collimate, --dose, --kvp, --mas, --photons, --pulse-rate, --stages and --seed, as
/// given.
struct FluoroscopeArguments {
  std::string c_arm, collimate, dose, stages;
  std::optional<double> field_mm, mas, photons, pulses_per_s;
  std::optional<int> kvp;
  std::optional<std::uint32_t> seed;
};

void add_fluoroscope_options(CLI::App& command, FluoroscopeArguments& options);

/// Nothing when none of the options was given: then pictures stay without noise. Otherwise what they ask for,
/// on a fixed single-plane C-arm unless another was named. Throws InputError.
std::optional<FluoroscopyOptions> parse_fluoroscope(const FluoroscopeArguments& options);

/// The voltage of `--opacity spectrum:KVP`; none for an opacity, or a spectrum from a file.
std::optional<int> tube_kvp(const std::string& opacity, const std::variant<Opacity, Spectrum>& attenuation);

/// What `--opacity spectrum:` chose, for the beam: a tube's voltage is held, a spectrum from a file replaces
/// the tube's. Throws InputError.
void use_spectrum(const std::string& opacity, const std::variant<Opacity, Spectrum>& attenuation,
                  FluoroscopyOptions& fluoroscopy);

/// The named C-arm's distances, size and pixels for what the view leaves open.
View on_c_arm(const FluoroscopeArguments& options, const std::optional<FluoroscopyOptions>& fluoroscopy,
              const View& view);

/// One line for what has no energies.
void note_on_energies(const Session& session);

/// Throws InputError for an --intensity that the detector's codes do not have.
void check_linear_codes(const DicomOptions& dicom);

/// The same, and for shaded surfaces.
void check_fluoroscopy(ShadingMode shading, const DicomOptions& dicom);

/// One line for a measuring field that is brighter than the detector's codes.
void note_on_saturation(bool is_saturated, const Session& session);

/// Greys with --gamma and --inverted.
std::vector<std::uint8_t> displayed(std::vector<std::uint8_t> greys, const GreyOptions& grey);

/// A single frame: .png what is shown, .dcm the detector's codes, others the raw signal.
void write_fluoroscopy(const Fluoroscope& fluoroscope, const FluoroscopyFrame& frame, const View& view,
                       const std::string& file, const GreyOptions& grey, XaOptions xa);

/// Nothing for a spectrum from a file, and for photons that no tube gives.
std::optional<XaExposure> exposure_of(const Fluoroscope& fluoroscope, const Technique& technique);

/// {"c_arm", "kvp", "mas", "air_kerma_mGy", "dap_Gycm2", "fluoroscopy_s", "pulses", "images"} and the
/// same in a line.
Json to_json(const Fluoroscope& fluoroscope, const Technique& technique);
std::string summary(const Fluoroscope& fluoroscope, const Technique& technique);

}  // namespace xraycast::cli
