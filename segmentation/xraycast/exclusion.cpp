#include "xraycast/exclusion.hpp"

#include "xraycast/components.hpp"
#include "xraycast/parallel.hpp"

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

/// Dense voxels in parts too large for plaques, none of them metal or blooming.
Mask dense_bone(const Volume& volume, const HuWindow& window) {
  Mask dense = between(volume, window.high_hu, 32767), metal = between(volume, kMetal_hu, 32767);
  const Box box = grown(
      bounding_box(metal),
      static_cast<std::int64_t>(
          std::ceil(kBlooming_mm / std::min({volume.geometry().spacing_mm.x, volume.geometry().spacing_mm.y,
                                             volume.geometry().spacing_mm.z}))),
      volume.geometry().size);
  if (!box.empty()) {
    const VolumeGeometry& g = volume.geometry();
    const cv::Mat bloom = disc(g, kBlooming_mm);
    Mask blooming = metal;
    parallel_for(box.upper.z - box.lower.z, [&](std::int64_t i) {
      cv::Mat slice = slice_of(blooming, box.lower.z + i);
      if (cv::countNonZero(slice) > 0) cv::dilate(slice, slice, bloom);
    });
    const auto reach = static_cast<std::int64_t>(std::lround(kBlooming_mm / g.spacing_mm.z));
    parallel_for(box.upper.z - box.lower.z, [&](std::int64_t i) {
      const std::int64_t z = box.lower.z + i;
      cv::Mat slice = slice_of(dense, z);
      for (std::int64_t k = std::max<std::int64_t>(0, z - reach); k <= std::min(g.size.z - 1, z + reach); ++k)
        slice.setTo(0, slice_of(blooming, k));
    });
  }
  const Components parts(dense);
  std::vector<bool> keep(static_cast<std::size_t>(parts.count()));
  for (int c = 0; c < parts.count(); ++c)
    keep[static_cast<std::size_t>(c)] =
        static_cast<double>(parts.voxels(c)) * voxel_mm3(volume.geometry()) >= kPlaque_mm3;
  return parts.select(keep);
}

/// Takes off what within a slice is a band between two layers of bone: mostly bordered by bone and more than
/// four times as long as wide. A vessel on its way through bone is round.
void drop_bands(Mask& mask, const Mask& bone) {
  constexpr double kBordered = 0.5, kBand = 4;
  const cv::Mat neighbours = cv::getStructuringElement(cv::MORPH_RECT, {3, 3});
  parallel_for(mask.geometry.size.z, [&](std::int64_t z) {
    cv::Mat slice = slice_of(mask, z);
    if (cv::countNonZero(slice) == 0) return;
    const cv::Mat bones(slice.rows, slice.cols, CV_8UC1,
                        const_cast<std::uint8_t*>(&bone.voxels[bone.offset({0, 0, z})]));
    cv::Mat labels, stats, centroids, distance;
    const int count = cv::connectedComponentsWithStats(slice, labels, stats, centroids, 8, CV_32S);
    cv::distanceTransform(slice, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    for (int label = 1; label < count; ++label) {
      const int* s = stats.ptr<int>(label);
      const cv::Rect tight(s[cv::CC_STAT_LEFT], s[cv::CC_STAT_TOP], s[cv::CC_STAT_WIDTH],
                           s[cv::CC_STAT_HEIGHT]);
      const cv::Rect box = cv::Rect(tight.x - 1, tight.y - 1, tight.width + 2, tight.height + 2) &
                           cv::Rect(0, 0, slice.cols, slice.rows);
      const cv::Mat blob = labels(box) == label;
      double radius = 0;
      cv::minMaxLoc(distance(box), nullptr, &radius, nullptr, nullptr, blob);
      if (s[cv::CC_STAT_AREA] < kBand * 4 * radius * radius) continue;
      cv::Mat ring;
      cv::dilate(blob, ring, neighbours);
      ring &= ~blob;
      if (cv::countNonZero(ring & (bones(box) != 0)) > kBordered * cv::countNonZero(ring))
        slice(box).setTo(0, blob);
    }
  });
}

}  // namespace

Mask find_bone(const Volume& volume, const HuWindow& window, const Mask& vessels) {
  cv::setNumThreads(1);  // slices run in parallel already
  Mask bone = dense_bone(volume, window);
  const VolumeGeometry& g = volume.geometry();
  const cv::Mat closing = disc(g, kClosing_mm), rim = cv::getStructuringElement(cv::MORPH_ELLIPSE, {3, 3});
  const double pixel_mm2 = g.spacing_mm.x * g.spacing_mm.y;
  parallel_for(g.size.z, [&](std::int64_t z) {
    cv::Mat slice = slice_of(bone, z);
    if (cv::countNonZero(slice) == 0) return;
    cv::Mat closed;
    cv::morphologyEx(slice, closed, cv::MORPH_CLOSE, closing);
    const cv::Mat vessel(slice.rows, slice.cols, CV_8UC1,
                         const_cast<std::uint8_t*>(&vessels.voxels[vessels.offset({0, 0, z})]));
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
  drop_bands(mask, bone);
  const Components parts(mask);
  const Index3 size = mask.geometry.size;
  std::vector<std::int64_t> faces(static_cast<std::size_t>(parts.count())), on_bone(faces.size());
  for (const Components::Run& run : parts.runs()) {
    const Index3 first(run.first % size.x, run.first / size.x % size.y, run.first / (size.x * size.y));
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
