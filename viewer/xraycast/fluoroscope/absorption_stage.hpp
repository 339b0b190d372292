#pragma once

#include "xraycast/fluoroscope/beam.hpp"
#include "xraycast/fluoroscope/picture_rows.hpp"

#include <span>
#include <variant>

namespace xraycast {

/// What the rays of a picture have met: optical depths, or masses of kMaterials.
using RayDepths = std::variant<std::span<const float>, const MaterialDepths*>;

/// A beam with its table of optical depths.
struct BeamAndTable {
  const FluoroscopyBeam* beam;
  const QuantaTable* table;
};

/// Absorption in the patient: how many of the open field's quanta are detected behind it, and their energies.
struct AbsorptionStage {
  explicit AbsorptionStage(const PictureSize& picture);

  /// Rows in any order, on any threads.
  void absorb_row(int j, const BeamAndTable& beam, const RayDepths& rays);

  PictureSize size;
  PixelPlane share, mean_kev, spread_kev;
};

}  // namespace xraycast
