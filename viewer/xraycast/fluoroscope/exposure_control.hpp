#pragma once

#include "xraycast/fluoroscope/exposure.hpp"

#include <functional>
#include <optional>

namespace xraycast {

/// Automatic exposure control: from the mean signal in the measuring field the water in the beam follows,
/// from that the next pulse's voltage and mAs.
///
/// The voltage rises with the water, from 60 kV at 8 cm by 1.5 kV a cm, and the mAs make up the rest, within
/// the limits of tube and generator; where these are reached, the voltage rises or falls further. Such curves
/// are described by P.-J. P. Lin, P. Rauch et al., Functionality and operation of fluoroscopic automatic
/// brightness control/automatic dose rate control logic, AAPM report 125, 2012; this one is chosen here. The
/// air kerma rate stays below a limit.
class ExposureControl {
 public:
  /// The mean signal of a pixel in keV a mAs behind water, at a voltage.
  using SignalPerMas = std::function<double(int kvp, double g_cm2)>;
  /// The most mAs of a pulse that the limit of the air kerma rate permits at a voltage.
  using PermittedMas = std::function<double(int kvp)>;

  ExposureControl(XrayTube tube, double target_kev, std::optional<int> kvp, std::optional<double> mas,
                  SignalPerMas signal, PermittedMas permitted);

  /// For a trunk of 20 cm.
  Technique start() const { return technique_for(20); }

  /// After a pulse with `now` that gave this mean signal. Within 3 % of the target nothing changes.
  Technique next(const Technique& now, double measured_kev) const;

  /// For a path of water in the beam.
  Technique technique_for(double g_cm2) const;

 private:
  double water_g_cm2(const Technique& now, double measured_kev) const;
  double within_limits(int kvp, double mas) const;

  XrayTube tube_;
  double target_kev_;
  std::optional<int> kvp_;
  std::optional<double> mas_;
  SignalPerMas signal_;
  PermittedMas permitted_;
};

}  // namespace xraycast
