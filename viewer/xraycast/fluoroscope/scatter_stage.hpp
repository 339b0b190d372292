#pragma once

#include "xraycast/display/cell_ramps.hpp"
#include "xraycast/fluoroscope/c_arm.hpp"
#include "xraycast/fluoroscope/detector_view.hpp"
#include "xraycast/fluoroscope/pixel_loops.hpp"
#include "xraycast/fluoroscope/scatter.hpp"
#include "xraycast/fluoroscope/water_path.hpp"

#include <optional>

namespace xraycast {

/// Scattered radiation behind the grid, on cells of the picture.
class ScatterStage {
 public:
  ScatterStage(const DetectorView& seen, const std::optional<AntiscatterGrid>& grid);

  /// Adds a row to its cells; bands on any threads, their rows in order. `share`: of the open field's quanta,
  /// behind the patient; `field`: of the beam.
  void gather_row(int j, const float* share, const float* field);

  /// After a band's rows, which begin with `first`: the water in the way of its cells.
  void weigh_band(int first, const QuantaTable& table, const WaterPath& path);

  /// After all bands: what the cells scatter onto each other.
  void spread() { result_ = scatter_.from(primary_, water_); }

  /// Row j of the scattered quanta, as shares of the open field's, between the cells' middles.
  void row(int j, float* scattered) const;

 private:
  PictureSize size_;
  float weight_;
  CellRamps ramps_;
  int columns_;
  Scatter scatter_;
  PixelPlane share_, primary_, water_;
  std::span<const float> result_;
};

}  // namespace xraycast
