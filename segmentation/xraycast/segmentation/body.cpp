#include "xraycast/segmentation/body.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/segmentation/threshold.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>

namespace xraycast {
namespace {

constexpr double kBody_hu = -300, kOpening_mm = 10;
constexpr std::int64_t kMinShare = 50;  ///< a forearm has a litre, a trunk some forty

/// Morphology of every slice, with a square as wide as the opening.
void morph(Mask& mask, cv::MorphTypes operation) {
  cv::setNumThreads(1);  // slices run in parallel already
  const VolumeGeometry& g = mask.geometry;
  const auto voxels = [](double mm) { return std::max(1, static_cast<int>(std::lround(kOpening_mm / mm))); };
  const cv::Mat square =
      cv::getStructuringElement(cv::MORPH_RECT, {voxels(g.spacing_mm.x), voxels(g.spacing_mm.y)});
  parallel_for(g.size.z, [&](std::int64_t z) {
    cv::Mat slice(static_cast<int>(g.size.y), static_cast<int>(g.size.x), CV_8UC1,
                  &mask.voxels[mask.offset({0, 0, z})]);
    cv::morphologyEx(slice, slice, operation, square);
  });
}

/// How far a part reaches in a slice: along each row, and along each column.
struct Reach {
  struct Span {
    std::int64_t first, last;
    void add(std::int64_t from, std::int64_t to) {
      first = std::min(first, from);
      last = std::max(last, to);
    }
  };
  std::vector<Span> rows, columns;

  explicit Reach(const Index3& size)
      : rows(static_cast<std::size_t>(size.y), {size.x, -1}),
        columns(static_cast<std::size_t>(size.x), {size.y, -1}) {}

  /// On how many of its four sides the part lies around a voxel.
  int sides(std::int64_t x, std::int64_t y) const {
    const Span &row = rows[static_cast<std::size_t>(y)], &column = columns[static_cast<std::size_t>(x)];
    return static_cast<int>(row.first <= x) + static_cast<int>(x <= row.last) +
           static_cast<int>(column.first <= y) + static_cast<int>(y <= column.last);
  }
};

}  // namespace

Mask find_body(const Volume& volume) {
  Mask body = between(volume, kBody_hu, 32767);
  morph(body, cv::MORPH_OPEN);
  const Components parts(body);
  if (parts.count() == 0) {
    std::ranges::fill(body.voxels, 1);
    return body;
  }
  const Index3 size = body.geometry.size;
  std::vector<std::map<int, Reach>> slices(static_cast<std::size_t>(size.z));
  for (const Components::Run& run : parts.runs()) {
    if (kMinShare * parts.voxels(run.component) < parts.voxels(parts.largest())) continue;
    const Index3 first = voxel_at(body.geometry, run.first);
    Reach& reach = slices[static_cast<std::size_t>(first.z)].try_emplace(run.component, size).first->second;
    reach.rows[static_cast<std::size_t>(first.y)].add(first.x, first.x + run.length - 1);
    for (std::int64_t x = first.x; x < first.x + run.length; ++x)
      reach.columns[static_cast<std::size_t>(x)].add(first.y, first.y);
  }
  parallel_for(size.z, [&](std::int64_t z) {
    for (std::int64_t y = 0; y < size.y; ++y)
      for (std::int64_t x = 0; x < size.x; ++x)
        body[{x, y, z}] = std::ranges::any_of(slices[static_cast<std::size_t>(z)],
                                              [&](const auto& part) { return part.second.sides(x, y) >= 3; });
  });
  morph(body, cv::MORPH_DILATE);  // the opening took ears and folds of skin off too
  return body;
}

}  // namespace xraycast
