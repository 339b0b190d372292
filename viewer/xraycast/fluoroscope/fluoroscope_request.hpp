#pragma once

#include "xraycast/fluoroscope/fluoroscopy_options.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// A fluoroscope as it is asked for: by names and numbers. What is left out has its usual value.
struct FluoroscopeRequest {
  std::string c_arm{};  ///< a preset's name, or a JSON file; empty: a fixed single-plane C-arm's tube and
                        ///< detector, with the view as it is
  std::optional<double> field_mm{};  ///< one of the C-arm's; the largest if left out
  std::vector<double> collimate{};   ///< width and height at the detector in mm, and rotation in degrees
  std::string dose{};                ///< low, normal (default), or cine
  std::optional<int> kvp{};
  std::optional<double> mas{}, photons{}, pulse_rate{};
  std::optional<double> compression{};  ///< of the display's range, 0 to 1; the C-arm's if left out
  std::string stages{};                 ///< as FluoroscopyStages::from_list; empty: all
  std::optional<std::uint32_t> seed{};

  bool operator==(const FluoroscopeRequest&) const = default;
};

/// Throws InputError for a name that is unknown, a field that the C-arm has not, and as `check`.
FluoroscopyOptions options_of(const FluoroscopeRequest& request);

/// The named C-arm's distances, size and pixels for what the view leaves open; without a name the view.
View on_c_arm(const FluoroscopeRequest& request, const View& view);

}  // namespace xraycast
