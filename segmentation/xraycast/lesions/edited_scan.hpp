#pragma once

#include "xraycast/lesions/edited_lumen.hpp"
#include "xraycast/volume/volume.hpp"

#include <functional>
#include <optional>

namespace xraycast {

/// How a scan shows vessels at a place.
struct ScanMatch {
  double tissue_hu, lumen_hu;
  double blur_mm;  ///< standard deviation of the scan's point spread, beside the voxels' own width
};

/// What is to be changed in a scan.
struct ScanChange {
  BoxMm box_mm;
  AskSource source;
  std::optional<double> wall_hu;  ///< of what takes the lumen's place; the tissue's without
  double middle_fill = 1;         ///< how full the vessels' middles are: less than 1 in thin ones
};

/// Changes a scan as its lumen changes from `lumen` on. Lumen, tissue and blur are those by which a blurred
/// lumen explains the voxels around it best, by least squares; the difference of two such models, before and
/// after, is added, so that noise stays as it is and edges have the scan's own blur. Where new lumen
/// displaces other structures these vanish, and of their voxels' values only what may be noise is kept, up to
/// three standard deviations (`noise_hu`). Voxels that change by less than half a unit stay.
ScanMatch change_scan(Volume& scan, const VoxelLumen& lumen, const ScanChange& change, double noise_hu,
                      Progress& progress);

}  // namespace xraycast
