#include "xraycast/fluoroscope/scatter_stage.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

namespace xraycast {
namespace {

constexpr int kCell = PictureSize::kBand;
constexpr int kGatheredEvery = 4;  // rows, which will do for what scatter blurs over centimetres

/// The optical depth at which the table, which falls, has a share; between steps on a line.
double tau_of(float share, const QuantaTable& table) {
  const auto& steps = table.steps;
  const auto after =
      std::lower_bound(steps.begin(), steps.end(), share,
                       [](const QuantaTable::Step& step, float least) { return step.share > least; });
  if (after == steps.begin()) return 0;
  const auto step = static_cast<double>(after - steps.begin());
  if (after == steps.end()) return (step - 1) / table.steps_per_tau;
  const float above = (after - 1)->share, below = after->share;
  return (step - (share - below) / (above - below)) / table.steps_per_tau;
}

/// The whole cells of the beam beyond the picture, on each side.
Scatter::Beyond beyond_picture(const DetectorView& seen) {
  const auto cells = [&](double beam_mm, int pixels) {
    return static_cast<int>(std::max(0.0, 0.5 * (beam_mm / seen.pixel_mm - pixels) / kCell));
  };
  return {cells(seen.beam_width_mm, seen.size.width), cells(seen.beam_height_mm, seen.size.height)};
}

}  // namespace

ScatterStage::ScatterStage(const DetectorView& seen, const std::optional<AntiscatterGrid>& grid)
    : size_(seen.size),
      weight_(grid ? static_cast<float>(grid->scatter / grid->primary) : 1),
      ramps_(size_, kCell),
      columns_(ramps_.columns()),
      scatter_(columns_, ramps_.rows(), kCell * seen.pixel_mm, beyond_picture(seen)) {
  for (PixelPlane* plane : {&share_, &primary_, &water_}) plane->resize(ramps_.cells());
}

void ScatterStage::gather_row(int j, const float* share, const float* field) {
  const std::size_t cells = static_cast<std::size_t>(j / kCell) * static_cast<std::size_t>(columns_);
  if (j % kCell == 0)
    for (PixelPlane* plane : {&share_, &primary_}) std::fill_n(&(*plane)[cells], columns_, 0.0f);
  if (j % kGatheredEvery == 0) add_to_cells_row(share, field, size_.width, &share_[cells], &primary_[cells]);
}

void ScatterStage::weigh_band(int first, const QuantaTable& table, const WaterPath& path) {
  const std::size_t cells = static_cast<std::size_t>(first / kCell) * static_cast<std::size_t>(columns_);
  const int rows = (std::min(kCell, size_.height - first) + kGatheredEvery - 1) / kGatheredEvery;
  for (int column = 0; column < columns_; ++column) {
    const std::size_t cell = cells + static_cast<std::size_t>(column);
    const auto pixels = static_cast<float>(rows * std::min(kCell, size_.width - column * kCell));
    water_[cell] = static_cast<float>(path.g_cm2(tau_of(share_[cell] / pixels, table)));
    primary_[cell] /= pixels;
  }
}

void ScatterStage::row(int j, float* scattered) const { ramps_.row(result_.data(), weight_, j, scattered); }

}  // namespace xraycast
