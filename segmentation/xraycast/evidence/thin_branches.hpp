#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/mask/mask.hpp"
#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/volume/volume.hpp"

namespace xraycast {

/// What is known of the vessels that thin branches leave.
struct WideVessels {
  const Mask& mask;            ///< to their walls
  const Mask& excluded;        ///< bone
  const Mask& others;          ///< what is known to be something else
  double lumen_hu, tissue_hu;  ///< of their lumen, and of soft tissue
  double others_hu;  ///< from which something as bright and more than 3.7 mm in radius is another vessel or
                     ///< an organ
};

struct ThinBranches {
  Mask branches;
  Mask others;  ///< what grew beside them from elsewhere
};

/// Branches of vessels that are too thin for the brightness of their lumen: blur takes from a tube of radius
/// r all but 1 - exp(-r^2 / 2 s^2) of its contrast. The scan smoothed by two Gaussians tells a tube's radius
/// and its contrast (the Laplacian on the axis is r^2 / s^4 exp(-r^2 / 2 s^2) of it), and so what its lumen
/// would have without blur. Where that is the vessels' lumen, and no sheet, branches grow, the brightest
/// voxels first, from these vessels and from all others at once, so that an artery that a vein touches ends
/// there. Branches that reach less than 5 mm away are left out. A stage of `progress`. Throws DeviceError.
ThinBranches find_thin_branches(const Volume& volume, const WideVessels& vessels, ComputeDevice& device,
                                Progress& progress);

}  // namespace xraycast
