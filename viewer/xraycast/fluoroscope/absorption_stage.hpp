#pragma once

#include "xraycast/display/picture_rows.hpp"
#include "xraycast/fluoroscope/beam.hpp"
#include "xraycast/fluoroscope/water_path.hpp"

#include <vector>

namespace xraycast {

/// A beam with its table of optical depths.
struct BeamAndTable {
  const FluoroscopyBeam* beam;
  const QuantaTable* table;
};

/// Absorption in the patient: how many of the open field's quanta are detected behind it, and their energies.
struct AbsorptionStage {
  explicit AbsorptionStage(const PictureSize& picture);

  /// Before the rows of a pulse.
  void begin(const BeamAndTable& beam, const RayDepths& rays);

  /// Rows in any order, on any threads.
  void absorb_row(int j, const BeamAndTable& beam, const RayDepths& rays);

  PictureSize size;
  PixelPlane share, mean_kev, spread_kev;
  std::vector<std::vector<double>> solids_cm2_g;  ///< of each solid, in each bin of the beam
};

}  // namespace xraycast
