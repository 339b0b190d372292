#pragma once

#include <string>

namespace xraycast {

/// Which parts of the chain from the beam to the picture are on.
struct FluoroscopyStages {
  bool quanta = true;       ///< Poisson noise of the absorbed quanta
  bool blur = true;         ///< focal spot, pixel aperture and scintillator
  bool lag = true;          ///< charge of earlier frames
  bool electronics = true;  ///< electronic noise, gain, bits and saturation
  bool scatter = true;
  bool display = true;  ///< edge enhancement and temporal filter

  /// `quanta,blur`, or `none`. Throws InputError listing the stages.
  static FluoroscopyStages from_list(const std::string& list);
};

}  // namespace xraycast
