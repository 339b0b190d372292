#include "xraycast/segmentation/other_vessels.hpp"

#include "xraycast/mask/touching_systems.hpp"
#include "xraycast/segmentation/seeds.hpp"

#include <vector>

namespace xraycast {
namespace {

/// The voxels of a mask at those points that lie in it.
std::vector<Index3> voxels_at(const std::vector<glm::dvec3>& points_mm, const Mask& mask,
                              const std::string& name) {
  std::vector<Index3> voxels;
  for (const glm::dvec3& p : points_mm)
    if (is_near(mask, p)) voxels.push_back(nearest_voxel(mask, p, name));
  return voxels;
}

}  // namespace

Mask take_off_other_vessels(Mask& mask, Markers& markers, const std::string& name) {
  const std::vector<Index3> own = voxels_at(markers.vessels_mm, mask, name),
                            others = voxels_at(markers.not_vessels_mm, mask, name);
  if (own.empty() || others.empty()) return Mask(mask.geometry);
  Mask taken = touching_system(mask, own, others, markers.max_radius_mm);
  std::erase_if(markers.not_vessels_mm, [&](const glm::dvec3& p) {
    return is_near(mask, p) && taken[nearest_voxel(mask, p, name)] != 0;
  });
  subtract(mask, taken);
  return taken;
}

}  // namespace xraycast
