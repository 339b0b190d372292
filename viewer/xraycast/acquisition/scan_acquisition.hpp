#pragma once

#include "xraycast/acquisition/acquisition.hpp"
#include "xraycast/attenuation/spectrum.hpp"
#include "xraycast/casting/spectral_scan.hpp"
#include "xraycast/scene/absorbing_surfaces.hpp"
#include "xraycast/scene/implant.hpp"

#include <optional>
#include <vector>

namespace xraycast {

/// What `spectrum:` chose, for the beam: a tube's voltage is held, a spectrum from a file replaces the
/// tube's. `name` is as it was given: `spectrum:80`, or `spectrum:FILE`. Throws InputError where voltages
/// contradict each other, and as `check`.
void use_spectrum(const std::string& name, const Spectrum& spectrum, FluoroscopyOptions& options);

/// The voltage of a tube's spectrum; none for one from a file.
std::optional<int> tube_kvp(const std::string& name, const Spectrum& spectrum);

/// Whether a cone's source lies inside the body, so that the tissue behind it is not in the picture.
bool is_source_within(const View& view, const VolumeGeometry& volume, const BodyOutline& body);

/// Pictures of a scan on a device by the projector.
class ScanAcquisition {
 public:
  struct Scene {
    const SpectralScan& scan;
    Attenuation attenuation;
    std::vector<Surface> surfaces{};  ///< vessels and instruments in it, which attenuate
    std::vector<Implant> implants{};
    /// One picture takes less time than finding the constant blocks of the scan.
    Sampling sampling = Sampling::everywhere;
  };

  /// The scan must outlive it. Throws as Acquisition, and InputError for vessels and instruments in a
  /// spectrum's picture.
  ScanAcquisition(Scene scene, const AcquisitionOptions& options, const View& first);
  ScanAcquisition(const ScanAcquisition&) = delete;
  ScanAcquisition& operator=(const ScanAcquisition&) = delete;

  /// The next frame. Throws DeviceError when the device fails.
  AcquiredFrame frame(const View& view, Progress& progress);

  const Acquisition& acquisition() const { return acquisition_; }
  double kernel_ms() const { return drr_.kernel_ms; }  ///< of the last frame

 private:
  RayDepths rays(const View& view, Progress& progress);
  std::vector<std::vector<float>> implants_g_cm2(const View& view) const;
  const RayMasses& masses_with(std::vector<std::vector<float>> implants_g_cm2);

  Scene scene_;
  Acquisition acquisition_;
  AbsorbingSurfaces surfaces_;  ///< implants included, but for a spectrum
  std::optional<SpectrumModel> spectrum_;
  std::vector<AbsorbingSurfaces> implants_;  ///< with a spectrum, each; they attenuate by their g/cm2
  ProjectionImage drr_;
  ProjectedMasses masses_;
  RayMasses ray_masses_{masses_.g_cm2};  ///< with the implants'
};

}  // namespace xraycast
