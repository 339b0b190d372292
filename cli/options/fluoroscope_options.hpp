#pragma once

#include "options/command.hpp"
#include "options/view_options.hpp"
#include "xraycast/acquisition/acquisition.hpp"
#include "xraycast/fluoroscope/fluoroscope_request.hpp"

#include <optional>
#include <string>

namespace xraycast::cli {

/// --c-arm, --field, --collimate, --dose, --kvp, --mas, --photons, --pulse-rate, --stages and --seed, as
/// given.
struct FluoroscopeArguments {
  FluoroscopeRequest request;
  std::string collimate;
};

void add_fluoroscope_options(CLI::App& command, FluoroscopeArguments& options);

/// What a page's fluoroscope takes of them: --c-arm, --dose, --pulse-rate, --compression and --seed.
void add_page_fluoroscope_options(CLI::App& command, FluoroscopeRequest& request);

/// Nothing when none of the options was given: then pictures stay without noise. Otherwise what they ask for.
/// Throws InputError.
std::optional<FluoroscopyOptions> parse_fluoroscope(const FluoroscopeArguments& options);

/// One line for what has no energies.
void note_on_energies(const Invocation& invocation);

/// Throws InputError for an --intensity that the detector's codes do not have.
void check_linear_codes(const DicomOptions& dicom);

/// One line for a measuring field that is brighter than the detector's codes.
void note_on_saturation(bool is_saturated, const Invocation& invocation);

/// What they ask for.
GreyDisplay display_of(const GreyOptions& grey);

/// {"c_arm", "kvp", "mas", "air_kerma_mGy", "dap_Gycm2", "fluoroscopy_s", "pulses", "images"} and the
/// same in a line.
Json to_json(const ExposureRecord& exposure);
std::string summary(const ExposureRecord& exposure);

}  // namespace xraycast::cli
