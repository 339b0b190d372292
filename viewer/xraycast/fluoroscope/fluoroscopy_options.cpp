#include "xraycast/fluoroscope/fluoroscopy_options.hpp"

#include "xraycast/base/error.hpp"

#include <cmath>

namespace xraycast {
namespace {

void check_exposure(std::optional<double> value, double most, const char* unit) {
  if (value && !(*value > 0 && *value <= most))
    throw InputError("an exposure of {:g} {}: must be above 0 and at most {:g}", *value, unit, most);
}

}  // namespace

void check(const FluoroscopyOptions& options) {
  constexpr double kMostMas = 2000, kMostPhotons = 1e7, kLowestRate = 3, kHighestRate = 30;
  check_exposure(options.mas, kMostMas, "mAs");
  check_exposure(options.photons, kMostPhotons, "photons per pixel");
  if (options.photons && options.mas)
    throw InputError("photons and mAs are both given, but each sets the exposure; give one of them");
  const XrayTube& tube = options.c_arm.tube;
  if (options.kvp && !(*options.kvp >= tube.lowest_kvp && *options.kvp <= tube.highest_kvp))
    throw InputError("{} kVp: {} allows {:g} to {:g} kVp; choose a voltage in this range", *options.kvp,
                     options.c_arm.name, tube.lowest_kvp, tube.highest_kvp);
  if (options.mas) {
    const int kvp = options.kvp.value_or(static_cast<int>(tube.lowest_kvp));
    if (const double most = highest_mas(tube, kvp); *options.mas > most)
      throw InputError("{:g} mAs: {} gives at most {:.3g} mAs per pulse at {} kVp; choose a lower value",
                       *options.mas, options.c_arm.name, most, kvp);
  }
  if (options.spectrum && !options.photons)
    throw InputError("{}: a spectrum from a file has no tube output; give the photons per pixel too",
                     options.spectrum->name());
  if (!(options.pulses_per_s >= kLowestRate && options.pulses_per_s <= kHighestRate))
    throw InputError("{:g} pulses/s: must be {:g} to {:g}", options.pulses_per_s, kLowestRate, kHighestRate);
  if (options.compression && !(*options.compression >= 0 && *options.compression <= 1))
    throw InputError("a compression of {:g}: must be 0 to 1", *options.compression);
  const auto& blades = options.collimation;
  if (blades && !(blades->width_mm > 0 && blades->height_mm > 0 && std::isfinite(blades->turn_rad)))
    throw InputError("the collimator is shut ({:g} x {:g} mm); open its blades", blades->width_mm,
                     blades->height_mm);
}

}  // namespace xraycast
