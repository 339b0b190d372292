#pragma once

#include "xraycast/base/error.hpp"
#include "xraycast/mask/mask.hpp"
#include "xraycast/opencl/compute_device.hpp"
#include "xraycast/segmentation/threshold.hpp"
#include "xraycast/segmentation/watershed.hpp"

#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// What removes a seed's structure, which says what would keep it.
enum class Removal {
  given_window,  ///< the CT numbers that the user asked for
  window,        ///< those that were chosen
  body,          ///< all but the body
  bone,
  chamber,  ///< structures wider than the largest radius
};

/// What a scan shows at a seed.
struct Seed {
  glm::dvec3 point_mm;
  double hu;            ///< median of the voxels around it that differ from its own by noise alone
  double tolerance_hu;  ///< by which lumen of its own brightness may differ
};

/// The scan in which the brightness of seeds and of what is connected to them is measured: smoothed by a
/// Gaussian of 0.8 mm, unless its noise is low enough. Throws DeviceError.
std::optional<Volume> smoothed_for_seeds(const Volume& volume, ComputeDevice& device);

/// The seeds among `markers`, as `scan` shows them. Lumen of a seed's own brightness differs from it by at
/// most a fifth of its contrast to soft tissue, or by two and a half standard deviations.
std::vector<Seed> look_at_seeds(const Volume& scan, const Markers& markers);

/// Whether a window does not suit a seed, given the mask of that window: one brighter than the window, or one
/// below it that does not lie on the rim of what is in the mask. Where no lumen can be as bright as the seed,
/// whether it lies farther than 5 mm from the mask.
bool needs_own_window(const Seed& seed, const HuWindow& window, const Mask& mask);

/// The CT numbers of the seeds, with their tolerances. Throws InputError, with `name` in front, for a seed in
/// air, in tissue without contrast agent, in metal, or in bone denser than any contrast agent.
HuWindow window_of_seeds(const std::vector<Seed>& seeds, const std::string& name);

/// Whether a point lies within 5 mm of a mask, as nearest_voxel accepts it.
bool is_near(const Mask& mask, const glm::dvec3& point_mm);

/// The component of a mask within 5 mm of a point; empty where there is none.
Mask structure_at(const Mask& mask, const glm::dvec3& point_mm);

/// Throws InputError for a seed farther than 5 mm from the mask that a removal has left: the message says
/// what the seed lies in, and which field of the request would keep it.
void check_seeds(const std::vector<Seed>& seeds, const Mask& mask, Removal removal, const std::string& name);

/// Lumen of the seeds' own brightness that is connected to them and narrower than the largest radius: no step
/// removes it. Grows through voxels of the body within the window and a seed's tolerance whose six neighbours
/// fulfil the same, so that it does not pass through the rim of bone, where every brightness occurs;
/// structures that hold a point to exclude are left out. Throws InputError if a seed lies in a wider
/// structure, or within bone.
Mask lumen_at_seeds(const Volume& scan, const std::vector<Seed>& seeds, const HuWindow& window,
                    const Mask& body, const Markers& markers, const std::string& name);

}  // namespace xraycast
