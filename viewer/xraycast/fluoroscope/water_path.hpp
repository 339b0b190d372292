#pragma once

#include "xraycast/attenuation/spectrum.hpp"

#include <functional>
#include <span>
#include <variant>
#include <vector>

namespace xraycast {

/// Masses that the rays of a picture have met, H x W, row 0 on top.
struct RayMasses {
  /// Of a solid, such as an implant, with its mass attenuation coefficient.
  struct Solid {
    std::vector<float> g_cm2;
    std::function<double(double energy_kev)> cm2_g;
  };
  const MaterialDepths& g_cm2;  ///< of kMaterials
  std::vector<Solid> solids{};
};

/// What the rays of a picture have met, H x W, row 0 on top: optical depths, or masses, with the energies
/// that these let through.
using RayDepths = std::variant<std::span<const float>, const RayMasses*>;

/// The water that attenuates as much as an optical depth of a picture: optical depths have no energies, and a
/// fluoroscope's beam is not the one that they were computed for. Piecewise linear.
class WaterPath {
 public:
  /// By water's optical depth a mm.
  explicit WaterPath(double water_per_mm);

  /// Water's path by its value in the opacity, see water_per_mm.
  explicit WaterPath(const Opacity& opacity);

  /// The path of water behind which the spectrum has the optical depth. Throws InputError for a spectrum that
  /// does not pass a centimetre.
  explicit WaterPath(const Spectrum& spectrum);

  /// What applies.
  explicit WaterPath(const Attenuation& attenuation);

  double g_cm2(double tau) const;
  bool operator==(const WaterPath&) const = default;

 private:
  std::vector<double> tau_, g_cm2_;
};

/// Water's optical depth a mm in an opacity; 0.02 where the opacity leaves water out.
double water_per_mm(const Opacity& opacity);

}  // namespace xraycast
