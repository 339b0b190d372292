#pragma once

#include "xraycast/acquisition/acquisition.hpp"
#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/casting/spectral_scan.hpp"
#include "xraycast/scene/absorbing_surfaces.hpp"

#include <optional>
#include <variant>
#include <vector>

namespace xraycast {

/// What `spectrum:` chose, for the beam: a tube's voltage is held, a spectrum from a file replaces the
/// tube's. `name` is as it was given: `spectrum:80`, or `spectrum:FILE`. Throws InputError where voltages
/// contradict each other, and as `check`.
void use_spectrum(const std::string& name, const Spectrum& spectrum, FluoroscopyOptions& options);

/// The voltage of a tube's spectrum; none for one from a file.
std::optional<int> tube_kvp(const std::string& name, const Spectrum& spectrum);

/// Pictures of a scan on a device by the projector, with vessels and devices in it, which attenuate.
class ScanAcquisition final : private RaySource {
 public:
  struct Scene {
    const SpectralScan& scan;
    std::variant<Opacity, Spectrum> attenuation;
    std::optional<Surface> vessels{};  ///< filled with contrast agent, which a mask has not
    std::vector<Surface> devices{};
    /// One picture takes less time than finding the constant blocks of the scan.
    Sampling sampling = Sampling::everywhere;
  };

  /// The scan must outlive it. Throws as Acquisition, and InputError for surfaces in a spectrum's picture.
  ScanAcquisition(Scene scene, const AcquisitionOptions& options, const View& first);

  /// The next frame. Throws DeviceError when the device fails.
  AcquiredFrame frame(const View& view, Progress& progress);

  const Acquisition& acquisition() const { return acquisition_; }
  double kernel_ms() const { return kernel_ms_; }  ///< of the last frame

 private:
  RayDepths rays(const View& view, bool has_contrast) override;
  RayDepths masses(const View& view, const Spectrum& spectrum);
  RayDepths depths(const View& view, const Opacity& opacity, bool has_contrast);

  Scene scene_;
  Acquisition acquisition_;
  AbsorbingSurfaces devices_, all_;
  ProjectionImage drr_;
  ProjectedMasses masses_;
  Progress* progress_ = nullptr;
  double kernel_ms_ = 0;
};

}  // namespace xraycast
