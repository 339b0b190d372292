#include "xraycast/fluoroscope/absorption_stage.hpp"

#include <algorithm>
#include <array>

namespace xraycast {
namespace {

/// Optical depths of solids in each bin of a beam, where a ray meets any.
std::span<const double> solid_depths(const AbsorptionStage& stage, const RayMasses& rays, std::size_t pixel,
                                     std::vector<double>& depths) {
  bool is_any = false;
  for (std::size_t s = 0; s < rays.solids.size(); ++s) {
    const double g_cm2 = rays.solids[s].g_cm2[pixel];
    if (!(g_cm2 > 0)) continue;
    const std::vector<double>& cm2_g = stage.solids_cm2_g[s];
    if (!is_any) depths.assign(cm2_g.size(), 0);
    is_any = true;
    for (std::size_t b = 0; b < depths.size(); ++b) depths[b] += cm2_g[b] * g_cm2;
  }
  return is_any ? std::span<const double>(depths) : std::span<const double>();
}

/// For files, since it sums the spectrum in every pixel.
void absorb_in_materials(const PictureSize& size, int j, const FluoroscopyBeam& beam, const RayMasses& rays,
                         AbsorptionStage& stage) {
  std::vector<double> solids;
  for (std::size_t pixel = size.row(j); pixel < size.row(j + 1); ++pixel) {
    std::array<double, kMaterials.size()> depths{};
    for (std::size_t m = 0; m < depths.size(); ++m)
      depths[m] = std::max(0.0f, rays.g_cm2[m][pixel]);  // 0 for NaN
    const EnergyMoments behind = beam.spectrum.behind(depths, solid_depths(stage, rays, pixel, solids));
    stage.share[pixel] = static_cast<float>(behind.m0 / beam.open.m0);
    stage.mean_kev[pixel] = static_cast<float>(behind.mean_kev());
    stage.spread_kev[pixel] = static_cast<float>(behind.spread_kev());
  }
}

}  // namespace

AbsorptionStage::AbsorptionStage(const PictureSize& picture)
    : size(picture), share(size.pixels()), mean_kev(size.pixels()), spread_kev(size.pixels()) {}

void AbsorptionStage::begin(const BeamAndTable& beam, const RayDepths& rays) {
  const auto* masses = std::get_if<const RayMasses*>(&rays);
  solids_cm2_g.assign(masses ? (*masses)->solids.size() : 0, {});
  for (std::size_t s = 0; s < solids_cm2_g.size(); ++s)
    for (const DetectedSpectrum::Bin& bin : beam.beam->spectrum.bins())
      solids_cm2_g[s].push_back((*masses)->solids[s].cm2_g(bin.energy_kev));
}

void AbsorptionStage::absorb_row(int j, const BeamAndTable& beam, const RayDepths& rays) {
  if (const auto* masses = std::get_if<const RayMasses*>(&rays))
    return absorb_in_materials(size, j, *beam.beam, **masses, *this);
  const std::size_t at = size.row(j);
  look_up_row(*beam.table, std::get<std::span<const float>>(rays).data() + at, size.width, share.data() + at,
              mean_kev.data() + at, spread_kev.data() + at);
}

}  // namespace xraycast
