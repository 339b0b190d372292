#include "xraycast/acquisition/scan_acquisition.hpp"

#include "xraycast/base/error.hpp"

#include <utility>

namespace xraycast {
namespace {

std::optional<WaterPath> path_of(const std::variant<Opacity, Spectrum>& attenuation,
                                 const AcquisitionOptions& options) {
  if (!options.fluoroscope) return std::nullopt;  // a spectrum may have none
  return std::visit([](const auto& one) { return WaterPath(one); }, attenuation);
}

}  // namespace

std::optional<int> tube_kvp(const std::string& name, const Spectrum& spectrum) {
  const std::string given = name.substr(name.find(':') + 1);
  if (spectrum.name() != given + " kVp") return std::nullopt;
  return std::stoi(given);
}

void use_spectrum(const std::string& name, const Spectrum& spectrum, FluoroscopyOptions& options) {
  const std::optional<int> kvp = tube_kvp(name, spectrum);
  if (!kvp && options.kvp)
    throw InputError("`kvp` {} with `opacity` {}: both set the tube voltage; leave one of them out",
                     *options.kvp, name);
  if (!kvp)
    options.spectrum = spectrum;
  else if (!options.kvp)
    options.kvp = kvp;
  check(options);
}

ScanAcquisition::ScanAcquisition(Scene scene, const AcquisitionOptions& options, const View& first)
    : scene_(std::move(scene)), acquisition_(options, first, path_of(scene_.attenuation, options)) {
  devices_.set(scene_.devices);
  all_.set(scene_.devices);
  if (scene_.vessels) all_.replace(scene_.devices.size(), *scene_.vessels);
  if (!all_.empty() && std::holds_alternative<Spectrum>(scene_.attenuation))
    throw InputError("`opacity` {}: vessels and devices take no spectrum; give an opacity",
                     std::get<Spectrum>(scene_.attenuation).name());
}

AcquiredFrame ScanAcquisition::frame(const View& view, Progress& progress) {
  progress_ = &progress;
  AcquiredFrame frame = acquisition_.take(*this, view);
  frame.tau = drr_.tau;
  return frame;
}

RayDepths ScanAcquisition::rays(const View& view, bool has_contrast) {
  if (const auto* spectrum = std::get_if<Spectrum>(&scene_.attenuation)) return masses(view, *spectrum);
  return depths(view, std::get<Opacity>(scene_.attenuation), has_contrast);
}

/// A fluoroscope's beam is not the spectrum of the optical depths.
RayDepths ScanAcquisition::masses(const View& view, const Spectrum& spectrum) {
  masses_ = project_masses(scene_.scan, view, *progress_);
  kernel_ms_ = masses_.kernel_ms;
  drr_.tau = SpectrumModel(spectrum).tau(masses_.g_cm2);
  if (!acquisition_.fluoroscope()) return drr_.tau;
  return &masses_.g_cm2;
}

RayDepths ScanAcquisition::depths(const View& view, const Opacity& opacity, bool has_contrast) {
  drr_ = project(scene_.scan.native, view, opacity, *progress_, {}, scene_.sampling);
  kernel_ms_ = drr_.kernel_ms;
  const AbsorbingSurfaces& surfaces = has_contrast ? all_ : devices_;
  if (!surfaces.empty()) surfaces.add_to(drr_.tau, view);
  return drr_.tau;
}

}  // namespace xraycast
