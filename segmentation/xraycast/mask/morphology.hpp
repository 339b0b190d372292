#pragma once

#include "xraycast/mask/mask.hpp"

#include <opencv2/imgproc.hpp>

namespace xraycast {

/// A slice of a mask as an OpenCV matrix, without a copy. Slices are processed in parallel, so callers call
/// cv::setNumThreads(1) first.
cv::Mat slice_view(Mask& mask, std::int64_t z);
const cv::Mat slice_view(const Mask& mask, std::int64_t z);

/// A structuring element within a slice: a disc of a radius in mm; at least a voxel.
cv::Mat disc(const VolumeGeometry& grid, double radius_mm);

/// Dilation by a cylinder along z: a disc of that radius, extended by the radius above and below.
Mask dilated_by_cylinder(const Mask& mask, double radius_mm);

/// Calls `visit(hole, box, area)` for every hole of a slice's mask, which is a 4-connected component of the
/// background that does not touch the slice's border: its own mask within its bounding box, and its pixels.
template <typename Visit>
void for_each_hole(const cv::Mat& mask, const Visit& visit) {
  cv::Mat background = mask == 0, labels, stats, centroids;
  const int count = cv::connectedComponentsWithStats(background, labels, stats, centroids, 4, CV_32S);
  for (int label = 1; label < count; ++label) {
    const int* s = stats.ptr<int>(label);
    const cv::Rect box(s[cv::CC_STAT_LEFT], s[cv::CC_STAT_TOP], s[cv::CC_STAT_WIDTH], s[cv::CC_STAT_HEIGHT]);
    if (box.x == 0 || box.y == 0 || box.br().x == mask.cols || box.br().y == mask.rows) continue;
    visit(labels(box) == label, box, s[cv::CC_STAT_AREA]);
  }
}

/// Fills the holes of a mask within each slice up to `max_area_mm2`.
void fill_holes(Mask& mask, double max_area_mm2);

}  // namespace xraycast
