#include "xraycast/fluoroscope/scatter_stage.hpp"

#include <cmath>
#include <functional>

namespace xraycast {
namespace {

constexpr int kCell = PictureSize::kBand;
constexpr int kGatheredEvery = 4;  // rows, which will do for what scatter blurs over centimetres

/// The optical depth at which the table, which falls, has a share; between steps on a line.
double tau_of(float share, const QuantaTable& table) {
  const auto after = std::ranges::lower_bound(table.share, share, std::greater{});
  if (after == table.share.begin()) return 0;
  const auto step = static_cast<double>(after - table.share.begin());
  if (after == table.share.end()) return (step - 1) / table.steps_per_tau;
  const float above = *(after - 1), below = *after;
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
      columns_((size_.width + kCell - 1) / kCell),
      scatter_(columns_, size_.bands(), kCell * seen.pixel_mm, beyond_picture(seen)) {
  const std::size_t cells = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(size_.bands());
  for (PixelPlane* plane : {&share_, &primary_, &water_}) plane->resize(cells);
}

void ScatterStage::gather_row(int j, const float* share, const float* field) {
  const std::size_t cells = static_cast<std::size_t>(j / kCell) * static_cast<std::size_t>(columns_);
  if (j % kCell == 0)
    for (PixelPlane* plane : {&share_, &primary_}) std::fill_n(&(*plane)[cells], columns_, 0.0f);
  if (j % kGatheredEvery != 0) return;
  for (int i = 0; i < size_.width; ++i) {
    share_[cells + static_cast<std::size_t>(i / kCell)] += share[i];
    primary_[cells + static_cast<std::size_t>(i / kCell)] += share[i] * field[i];
  }
}

void ScatterStage::spread(const QuantaTable& table, const WaterPath& path) {
  for (std::size_t cell = 0; cell < share_.size(); ++cell) {
    const int row = static_cast<int>(cell) / columns_, column = static_cast<int>(cell) % columns_;
    const int rows = (std::min(kCell, size_.height - row * kCell) + kGatheredEvery - 1) / kGatheredEvery;
    const auto pixels = static_cast<float>(rows * std::min(kCell, size_.width - column * kCell));
    water_[cell] = static_cast<float>(path.g_cm2(tau_of(share_[cell] / pixels, table)));
    primary_[cell] /= pixels;
  }
  result_ = scatter_.from(primary_, water_);
}

void ScatterStage::row(int j, float* scattered) const {
  const int rows = size_.bands();
  const float y =
      std::clamp((static_cast<float>(j) + 0.5f) / kCell - 0.5f, 0.0f, static_cast<float>(rows - 1));
  const int above = std::min(static_cast<int>(y), std::max(0, rows - 2)),
            below = std::min(above + 1, rows - 1);
  const float part = y - static_cast<float>(above);
  const auto at = [&](int column) {
    const int inside = std::clamp(column, 0, columns_ - 1);
    return weight_ * std::lerp(result_[above * columns_ + inside], result_[below * columns_ + inside], part);
  };
  // Between two middles the row is a ramp.
  for (int column = -1; column < columns_; ++column) {
    const float from = at(column), slope = (at(column + 1) - from) / kCell;
    const int start = column * kCell + kCell / 2;
    for (int i = std::max(0, start); i < std::min(size_.width, start + kCell); ++i)
      scattered[i] = from + slope * (static_cast<float>(i - start) + 0.5f);
  }
}

}  // namespace xraycast
