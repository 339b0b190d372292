#include "xraycast/mask/morphology.hpp"

#include "xraycast/base/parallel.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {

cv::Mat slice_view(Mask& mask, std::int64_t z) {
  return {static_cast<int>(mask.geometry.size.y), static_cast<int>(mask.geometry.size.x), CV_8UC1,
          &mask.voxels[mask.offset({0, 0, z})]};
}

const cv::Mat slice_view(const Mask& mask, std::int64_t z) { return slice_view(const_cast<Mask&>(mask), z); }

cv::Mat disc(const VolumeGeometry& grid, double radius_mm) {
  const int x = std::max(1, static_cast<int>(std::lround(radius_mm / grid.spacing_mm.x))),
            y = std::max(1, static_cast<int>(std::lround(radius_mm / grid.spacing_mm.y)));
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * x + 1, 2 * y + 1});
}

Mask dilated_by_cylinder(const Mask& mask, double radius_mm) {
  cv::setNumThreads(1);
  const VolumeGeometry& g = mask.geometry;
  Mask wide(g), result(g);
  const auto reach = static_cast<std::int64_t>(std::lround(radius_mm / g.spacing_mm.z));
  const Box box = bounding_box(mask);
  const cv::Mat around = disc(g, radius_mm);
  parallel_for(box.upper.z - box.lower.z, [&](std::int64_t i) {
    const std::int64_t z = box.lower.z + i;
    cv::dilate(slice_view(mask, z), slice_view(wide, z), around);
  });
  parallel_for(g.size.z, [&](std::int64_t z) {
    cv::Mat slice = slice_view(result, z);
    for (std::int64_t k = std::max(box.lower.z, z - reach); k <= std::min(box.upper.z - 1, z + reach); ++k)
      slice |= slice_view(wide, k);
  });
  return result;
}

void fill_holes(Mask& mask, double max_area_mm2) {
  cv::setNumThreads(1);
  const double pixel_mm2 = mask.geometry.spacing_mm.x * mask.geometry.spacing_mm.y;
  parallel_for(mask.geometry.size.z, [&](std::int64_t z) {
    cv::Mat slice = slice_view(mask, z);
    if (cv::countNonZero(slice) == 0) return;
    for_each_hole(slice, [&](const cv::Mat& hole, const cv::Rect& box, int area) {
      if (area * pixel_mm2 <= max_area_mm2) slice(box).setTo(1, hole);
    });
  });
}

}  // namespace xraycast
