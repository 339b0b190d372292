#include "xraycast/acquisition/scan_acquisition.hpp"

#include "xraycast/base/error.hpp"

#include <glm/geometric.hpp>

#include <utility>

namespace xraycast {

std::optional<int> tube_kvp(const std::string& name, const Spectrum& spectrum) {
  const std::string given = name.substr(name.find(':') + 1);
  if (spectrum.name() != given + " kVp") return std::nullopt;
  return std::stoi(given);
}

void use_spectrum(const std::string& name, const Spectrum& spectrum, FluoroscopyOptions& options) {
  const std::optional<int> kvp = tube_kvp(name, spectrum);
  if (options.kvp && options.kvp != kvp)
    throw InputError("`kvp` {} with `opacity` {}: both set the tube voltage; leave one of them out",
                     *options.kvp, name);
  if (kvp)
    options.kvp = kvp;
  else
    options.spectrum = spectrum;
  check(options);
}

bool is_source_within(const View& view, const VolumeGeometry& volume, const BodyOutline& body) {
  if (!view.cone) return false;
  const glm::dvec3 source_mm = view.source_mm();
  return glm::distance(glm::dvec2(source_mm), body.centre_mm) < body.radius_mm &&
         source_mm.z > volume.lower_mm().z && source_mm.z < volume.upper_mm().z;
}

ScanAcquisition::ScanAcquisition(Scene scene, const AcquisitionOptions& options, const View& first)
    : scene_(std::move(scene)), acquisition_(options, first, path_of(scene_.attenuation, options)) {
  surfaces_.set(scene_.surfaces);
  if (const auto* spectrum = std::get_if<Spectrum>(&scene_.attenuation); spectrum && !surfaces_.empty())
    throw InputError("`opacity` {}: vessels and instruments take no spectrum; give an opacity",
                     spectrum->name());
}

AcquiredFrame ScanAcquisition::frame(const View& view, Progress& progress) {
  AcquiredFrame frame = acquisition_.expose(rays(view, progress), view);
  frame.tau = drr_.tau;
  return frame;
}

/// A fluoroscope's beam is not the spectrum of the optical depths.
RayDepths ScanAcquisition::rays(const View& view, Progress& progress) {
  if (const auto* spectrum = std::get_if<Spectrum>(&scene_.attenuation)) {
    masses_ = project_masses(scene_.scan, view, progress);
    drr_ = {view, SpectrumModel(*spectrum).tau(masses_.g_cm2), masses_.kernel_ms};
    if (acquisition_.fluoroscope()) return &masses_.g_cm2;
  } else {
    drr_ = project(scene_.scan.native, view, std::get<Opacity>(scene_.attenuation), progress, {},
                   scene_.sampling);
    if (!surfaces_.empty()) surfaces_.add_to(drr_.tau, view);
  }
  return drr_.tau;
}

}  // namespace xraycast
