#include "xraycast/volume/volume.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/memory_limit.hpp"

#include <cmath>
#include <string>

namespace xraycast {

std::array<glm::dvec3, 8> corners_of(const glm::dvec3& lower, const glm::dvec3& upper) {
  std::array<glm::dvec3, 8> corners;
  for (std::size_t i = 0; i < 8; ++i)
    corners[i] = {i & 1 ? upper.x : lower.x, i & 2 ? upper.y : lower.y, i & 4 ? upper.z : lower.z};
  return corners;
}

void validate(const VolumeGeometry& geometry, const std::string& name) {
  constexpr std::int64_t kMaxSize = 65536;
  for (int axis = 0; axis < 3; ++axis) {
    if (geometry.size[axis] < 1 || geometry.size[axis] > kMaxSize)
      throw InputError("{}: size {} x {} x {} is outside 1 to {} per axis", name, geometry.size.x,
                       geometry.size.y, geometry.size.z, kMaxSize);
    if (!std::isfinite(geometry.spacing_mm[axis]) || geometry.spacing_mm[axis] <= 0)
      throw InputError("{}: voxel spacing {} x {} x {} mm must be finite and above zero", name,
                       geometry.spacing_mm.x, geometry.spacing_mm.y, geometry.spacing_mm.z);
    if (!std::isfinite(geometry.origin_mm[axis]))
      throw InputError("{}: the origin ({}, {}, {}) must be finite", name, geometry.origin_mm.x,
                       geometry.origin_mm.y, geometry.origin_mm.z);
  }
}

Volume::Volume(const VolumeGeometry& geometry, const std::string& name) : geometry_(geometry) {
  validate(geometry, name);
  const std::int64_t bytes = geometry.voxel_count() * static_cast<std::int64_t>(sizeof(std::int16_t));
  if (bytes > machine_memory_B())
    throw InputError("{}: {} x {} x {} voxels need {} GiB, more than this machine's memory; make it smaller",
                     name, geometry.size.x, geometry.size.y, geometry.size.z, bytes >> 30);
  require_memory(
      fmt::format("a scan of {} x {} x {} voxels", geometry.size.x, geometry.size.y, geometry.size.z),
      {bytes, bytes});
  hu_ = {new std::int16_t[static_cast<std::size_t>(geometry.voxel_count())],
         std::default_delete<std::int16_t[]>()};
}

Volume::Volume(const VolumeGeometry& geometry, std::int16_t* hu, Release release, const std::string& name)
    : geometry_(geometry), hu_(hu, std::move(release)) {
  validate(geometry, name);
}

}  // namespace xraycast
