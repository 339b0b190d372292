#pragma once

#include "xraycast/scan/scan.hpp"

#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

#include <cmath>
#include <filesystem>

namespace xraycast {

/// A scan, opened and read whole.
struct ReadScan {
  ScanInfo info;
  Volume volume;
  SliceSource::HuRange hu_range;
};

inline ReadScan read_scan(const std::filesystem::path& path, const ScanOptions& options = {}) {
  Progress progress;
  Scan scan = open_scan(path, options, progress);
  Volume volume = collect(*scan.source, progress);
  return {std::move(scan.info), std::move(volume), scan.source->hu_range()};
}

/// The voxel whose centre is nearest to a point that lies in the volume.
inline std::int16_t hu_at_mm(const Volume& volume, const glm::dvec3& world_mm) {
  const Index3 index(glm::round(volume.geometry().to_index(world_mm)));
  if (glm::any(glm::lessThan(index, Index3(0))) ||
      glm::any(glm::greaterThanEqual(index, volume.geometry().size)))
    throw std::out_of_range("the point lies outside the volume");
  return volume.at(index.x, index.y, index.z);
}

}  // namespace xraycast
