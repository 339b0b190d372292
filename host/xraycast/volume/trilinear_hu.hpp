#pragma once

#include "xraycast/volume/volume.hpp"

#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

#include <cmath>
#include <cstdint>

namespace xraycast {

/// The CT numbers of a scan between its voxels; air beyond its outer faces. The scan must outlive it.
class TrilinearHu {
 public:
  explicit TrilinearHu(const Volume& scan)
      : hu_(scan.hu().data()),
        size_(scan.geometry().size),
        last_(glm::dvec3(size_) - 1.0),
        origin_mm_(scan.geometry().origin_mm),
        per_mm_(1.0 / scan.geometry().spacing_mm) {}

  std::int16_t at(const glm::dvec3& x_mm) const {
    glm::dvec3 index = (x_mm - origin_mm_) * per_mm_;
    // Written so that NaN is air.
    if (!(glm::all(glm::greaterThanEqual(index, glm::dvec3(-0.5))) &&
          glm::all(glm::lessThanEqual(index, last_ + 0.5))))
      return kPaddingHu;
    index = glm::clamp(index, glm::dvec3(0), last_);
    const auto i = static_cast<std::int64_t>(index.x), j = static_cast<std::int64_t>(index.y),
               k = static_cast<std::int64_t>(index.z);
    const double u = index.x - static_cast<double>(i), v = index.y - static_cast<double>(j),
                 w = index.z - static_cast<double>(k);
    const std::int64_t right = i + 1 < size_.x ? 1 : 0, below = j + 1 < size_.y ? size_.x : 0,
                       above = k + 1 < size_.z ? size_.x * size_.y : 0;
    const std::int16_t* at = hu_ + (k * size_.y + j) * size_.x + i;
    const auto along_x = [&](std::int64_t offset) {
      return at[offset] + u * (at[offset + right] - at[offset]);
    };
    const double lower = along_x(0) + v * (along_x(below) - along_x(0));
    const double upper = along_x(above) + v * (along_x(above + below) - along_x(above));
    return static_cast<std::int16_t>(std::lrint(lower + w * (upper - lower)));
  }

 private:
  const std::int16_t* hu_;
  Index3 size_;
  glm::dvec3 last_;  ///< voxel
  glm::dvec3 origin_mm_;
  glm::dvec3 per_mm_;  ///< voxels
};

}  // namespace xraycast
