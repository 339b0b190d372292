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
  const auto* spectrum = std::get_if<Spectrum>(&scene_.attenuation);
  if (spectrum && !scene_.surfaces.empty())
    throw InputError("`opacity` {}: vessels and instruments take no spectrum; give an opacity",
                     spectrum->name());
  if (spectrum) {
    constexpr double kCm_per_mm = 0.1;
    std::vector<SolidMaterial> solids;
    for (const Implant& implant : scene_.implants) {
      solids.push_back(implant.material);
      implants_.emplace_back().set(std::vector{Surface{implant.mesh, kCm_per_mm * implant.material.g_cm3}});
    }
    spectrum_.emplace(*spectrum, kMaterials, solids);
    return;
  }
  std::vector<Surface> surfaces = scene_.surfaces;
  for (const Implant& implant : scene_.implants) surfaces.push_back(surface_of(implant));
  surfaces_.set(surfaces);
}

/// Of each.
std::vector<std::vector<float>> ScanAcquisition::implants_g_cm2(const View& view) const {
  std::vector<std::vector<float>> all;
  for (const AbsorbingSurfaces& implant : implants_)
    implant.add_to(all.emplace_back(masses_.g_cm2[0].size()), view);
  return all;
}

const RayMasses& ScanAcquisition::masses_with(std::vector<std::vector<float>> implants_g_cm2) {
  ray_masses_.solids.clear();
  for (std::size_t i = 0; i < implants_g_cm2.size(); ++i) {
    const SolidMaterial& solid = scene_.implants[i].material;
    ray_masses_.solids.push_back(
        {std::move(implants_g_cm2[i]), [&solid](double energy_kev) { return solid.cm2_g(energy_kev); }});
  }
  return ray_masses_;
}

AcquiredFrame ScanAcquisition::frame(const View& view, Progress& progress) {
  AcquiredFrame frame = acquisition_.expose(rays(view, progress), view);
  frame.tau = drr_.tau;
  return frame;
}

/// A fluoroscope's beam is not the spectrum of the optical depths.
RayDepths ScanAcquisition::rays(const View& view, Progress& progress) {
  if (spectrum_) {
    masses_ = project_masses(scene_.scan, view, progress);
    std::vector<std::vector<float>> implants = implants_g_cm2(view);
    drr_ = {view, spectrum_->tau(masses_.g_cm2, implants), masses_.kernel_ms};
    if (acquisition_.fluoroscope()) return &masses_with(std::move(implants));
  } else {
    drr_ = project(scene_.scan.native, view, std::get<Opacity>(scene_.attenuation), progress, {},
                   scene_.sampling);
    if (!surfaces_.empty()) surfaces_.add_to(drr_.tau, view);
  }
  return drr_.tau;
}

}  // namespace xraycast
