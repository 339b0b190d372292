#include "xraycast/segmentation/exclusion.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/mask/components.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace xraycast {
namespace {

constexpr double kMetal_hu = 2000, kBlooming_mm = 5, kPlaque_mm3 = 100;
constexpr double kClosing_mm = 2;     ///< closes cracks in cortical bone, less than the smallest canal
constexpr double kMarrow_mm2 = 1500;  ///< a vertebral body's section, and far less than a skull's
constexpr double kVesselShare = 0.3;  ///< of a hole, from which on it is a canal

double voxel_mm3(const VolumeGeometry& g) { return g.spacing_mm.x * g.spacing_mm.y * g.spacing_mm.z; }

/// A slice of a mask as OpenCV sees it, without a copy.
cv::Mat slice_of(Mask& mask, std::int64_t z) {
  return {static_cast<int>(mask.geometry.size.y), static_cast<int>(mask.geometry.size.x), CV_8UC1,
          &mask.voxels[mask.offset({0, 0, z})]};
}

const cv::Mat slice_of(const Mask& mask, std::int64_t z) { return slice_of(const_cast<Mask&>(mask), z); }

/// A disc of a radius in mm; at least a voxel.
cv::Mat disc(const VolumeGeometry& g, double radius_mm) {
  const int x = std::max(1, static_cast<int>(std::lround(radius_mm / g.spacing_mm.x))),
            y = std::max(1, static_cast<int>(std::lround(radius_mm / g.spacing_mm.y)));
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * x + 1, 2 * y + 1});
}

/// Calls `visit(labels, label, stats)` for all that a slice's mask encloses: parts of its outside that do not
/// touch the slice's border.
template <typename Visit>
void for_each_hole(const cv::Mat& mask, const Visit& visit) {
  cv::Mat outside = mask == 0, labels, stats, centroids;
  const int count = cv::connectedComponentsWithStats(outside, labels, stats, centroids, 4, CV_32S);
  for (int label = 1; label < count; ++label) {
    const int* s = stats.ptr<int>(label);
    const cv::Rect box(s[cv::CC_STAT_LEFT], s[cv::CC_STAT_TOP], s[cv::CC_STAT_WIDTH], s[cv::CC_STAT_HEIGHT]);
    if (box.x == 0 || box.y == 0 || box.br().x == mask.cols || box.br().y == mask.rows) continue;
    visit(labels(box) == label, box, s[cv::CC_STAT_AREA]);
  }
}

/// Dense voxels in parts too large for plaques, none of them metal or blooming. As many units of progress as
/// there are slices.
Mask dense_bone(const Volume& volume, const HuWindow& window, Progress& progress) {
  const std::int64_t slices = volume.geometry().size.z;
  Mask dense = between(volume, window.high_hu, 32767);
  progress.advance(slices / 4);
  const Mask blooming = dilated(between(volume, kMetal_hu, 32767), kBlooming_mm);
  for (std::size_t i = 0; i < dense.voxels.size(); ++i)
    dense.voxels[i] &= static_cast<std::uint8_t>(blooming.voxels[i] ^ 1);
  progress.advance(slices / 2);
  const Components parts(dense);
  std::vector<bool> keep(static_cast<std::size_t>(parts.count()));
  for (int c = 0; c < parts.count(); ++c)
    keep[static_cast<std::size_t>(c)] =
        static_cast<double>(parts.voxels(c)) * voxel_mm3(volume.geometry()) >= kPlaque_mm3;
  progress.advance(slices - slices / 4 - slices / 2);
  return parts.select(keep);
}

}  // namespace

Mask dilated(const Mask& mask, double radius_mm) {
  cv::setNumThreads(1);  // slices run in parallel already
  const VolumeGeometry& g = mask.geometry;
  Mask wide(g), result(g);
  const auto reach = static_cast<std::int64_t>(std::lround(radius_mm / g.spacing_mm.z));
  const Box box = bounding_box(mask);
  const cv::Mat around = disc(g, radius_mm);
  parallel_for(box.upper.z - box.lower.z, [&](std::int64_t i) {
    const std::int64_t z = box.lower.z + i;
    cv::dilate(slice_of(mask, z), slice_of(wide, z), around);
  });
  parallel_for(g.size.z, [&](std::int64_t z) {
    cv::Mat slice = slice_of(result, z);
    for (std::int64_t k = std::max(box.lower.z, z - reach); k <= std::min(box.upper.z - 1, z + reach); ++k)
      slice |= slice_of(wide, k);
  });
  return result;
}

Mask find_bone(const Volume& volume, const HuWindow& window, const Mask& vessels, Progress& progress) {
  cv::setNumThreads(1);
  const std::int64_t slices = volume.geometry().size.z;
  progress.begin("taking off bone", 2 * slices, "slices");
  Mask bone = dense_bone(volume, window, progress);
  const VolumeGeometry& g = volume.geometry();
  const cv::Mat closing = disc(g, kClosing_mm), rim = cv::getStructuringElement(cv::MORPH_ELLIPSE, {3, 3});
  const double pixel_mm2 = g.spacing_mm.x * g.spacing_mm.y;
  parallel_for(g.size.z, [&](std::int64_t z) {
    cv::Mat slice = slice_of(bone, z);
    progress.advance();
    if (cv::countNonZero(slice) == 0) return;
    cv::Mat closed;
    cv::morphologyEx(slice, closed, cv::MORPH_CLOSE, closing);
    const cv::Mat vessel = slice_of(vessels, z);
    for_each_hole(closed, [&](const cv::Mat& hole, const cv::Rect& box, int area) {
      if (area * pixel_mm2 > kMarrow_mm2) return;
      const int bright = cv::countNonZero(vessel(box) & hole);
      if (bright < kVesselShare * area) slice(box).setTo(1, hole);
    });
    cv::dilate(slice, slice, rim);
  });
  return bone;
}

void drop_marrow(Mask& mask, const Mask& bone) {
  const Components parts(mask);
  std::vector<std::int64_t> faces(static_cast<std::size_t>(parts.count())), on_bone(faces.size());
  for (const Components::Run& run : parts.runs()) {
    const Index3 first = voxel_at(mask.geometry, run.first);
    for (std::int64_t i = 0; i < run.length; ++i)
      for (std::size_t n = 0; n < 6; ++n) {
        const Index3 near = first + Index3(i, 0, 0) + kNeighbours[n];
        if (mask.at(near)) continue;
        ++faces[static_cast<std::size_t>(run.component)];
        if (bone.at(near)) ++on_bone[static_cast<std::size_t>(run.component)];
      }
  }
  std::vector<bool> keep(faces.size());
  for (std::size_t c = 0; c < keep.size(); ++c) keep[c] = 2 * on_bone[c] <= faces[c];
  mask = parts.select(keep);
}

void add_dense_wall(const Volume& volume, const HuWindow& window, const Mask& bone, Mask& vessels) {
  constexpr double kWall_mm = 1.5;
  const VolumeGeometry& g = volume.geometry();
  const auto steps =
      std::max(1L, std::lround(kWall_mm / std::max({g.spacing_mm.x, g.spacing_mm.y, g.spacing_mm.z})));
  const Box box = grown(bounding_box(vessels), steps, g.size);
  for (long step = 0; step < steps; ++step) {
    const Mask before = vessels;
    parallel_for(box.upper.z - box.lower.z, [&](std::int64_t i) {
      const std::int64_t z = box.lower.z + i;
      for (std::int64_t y = box.lower.y; y < box.upper.y; ++y)
        for (std::int64_t x = box.lower.x; x < box.upper.x; ++x) {
          const Index3 here(x, y, z);
          if (before[here] != 0 || volume.at(x, y, z) < window.high_hu || bone[here] != 0) continue;
          vessels[here] =
              std::ranges::any_of(kNeighbours, [&](const Index3& d) { return before.at(here + d); });
        }
    });
  }
}

void add_rim(const Mask& bright, Mask& vessels) {
  const Mask before = vessels;
  const Index3 size = vessels.geometry.size;
  parallel_for(size.z, [&](std::int64_t z) {
    for (std::int64_t y = 0; y < size.y; ++y)
      for (std::int64_t x = 0; x < size.x; ++x) {
        const Index3 here(x, y, z);
        if (bright[here] == 0 || before[here] != 0) continue;
        vessels[here] = std::any_of(kNeighbours.begin(), kNeighbours.begin() + 6,
                                    [&](const Index3& step) { return before.at(here + step); });
      }
  });
}

void fill_holes(Mask& mask, double area_mm2) {
  cv::setNumThreads(1);
  const double pixel_mm2 = mask.geometry.spacing_mm.x * mask.geometry.spacing_mm.y;
  parallel_for(mask.geometry.size.z, [&](std::int64_t z) {
    cv::Mat slice = slice_of(mask, z);
    if (cv::countNonZero(slice) == 0) return;
    for_each_hole(slice, [&](const cv::Mat& hole, const cv::Rect& box, int area) {
      if (area * pixel_mm2 <= area_mm2) slice(box).setTo(1, hole);
    });
  });
}

}  // namespace xraycast
