#include "xraycast/fluoroscope/absorption_stage.hpp"

#include <algorithm>
#include <array>

namespace xraycast {
namespace {

/// For files, since it sums the spectrum in every pixel.
void absorb_in_materials(const PictureSize& size, int j, const FluoroscopyBeam& beam,
                         const MaterialDepths& g_cm2, AbsorptionStage& stage) {
  for (std::size_t pixel = size.row(j); pixel < size.row(j + 1); ++pixel) {
    std::array<double, kMaterials.size()> depths{};
    for (std::size_t m = 0; m < depths.size(); ++m) depths[m] = std::max(0.0f, g_cm2[m][pixel]);  // 0 for NaN
    const EnergyMoments behind = beam.spectrum.behind(depths);
    stage.share[pixel] = static_cast<float>(behind.m0 / beam.open.m0);
    stage.mean_kev[pixel] = static_cast<float>(behind.mean_kev());
    stage.spread_kev[pixel] = static_cast<float>(behind.spread_kev());
  }
}

}  // namespace

AbsorptionStage::AbsorptionStage(const PictureSize& picture)
    : size(picture), share(size.pixels()), mean_kev(size.pixels()), spread_kev(size.pixels()) {}

void AbsorptionStage::absorb_row(int j, const BeamAndTable& beam, const RayDepths& rays) {
  if (const auto* masses = std::get_if<const MaterialDepths*>(&rays))
    return absorb_in_materials(size, j, *beam.beam, **masses, *this);
  const std::size_t at = size.row(j);
  look_up_row(*beam.table, std::get<std::span<const float>>(rays).data() + at, size.width, share.data() + at,
              mean_kev.data() + at, spread_kev.data() + at);
}

}  // namespace xraycast
