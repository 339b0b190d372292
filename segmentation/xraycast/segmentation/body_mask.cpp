#include "xraycast/segmentation/body_mask.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/mask/morphology.hpp"
#include "xraycast/segmentation/threshold.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace xraycast {
namespace {

constexpr double kBody_hu = -300, kOpening_mm = 10;
constexpr std::int64_t kMaxRatio = 50;  ///< to the largest: a forearm has a litre, a trunk some forty

/// A square as wide as the opening.
StructuringElement opening_square(const VolumeGeometry& g) {
  const auto voxels = [](double mm) { return std::max(1, static_cast<int>(std::lround(kOpening_mm / mm))); };
  return {StructuringElement::Shape::rectangle, voxels(g.spacing_mm.x), voxels(g.spacing_mm.y)};
}

/// The extent of a component in a slice: along each row, and along each column.
struct Extent {
  struct Span {
    std::int64_t first, last;
    void add(std::int64_t from, std::int64_t to) {
      first = std::min(first, from);
      last = std::max(last, to);
    }
  };
  std::vector<Span> rows, columns;

  explicit Extent(const Index3& size)
      : rows(static_cast<std::size_t>(size.y), {size.x, -1}),
        columns(static_cast<std::size_t>(size.x), {size.y, -1}) {}

  /// On how many of a voxel's four sides the component lies.
  int sides(std::int64_t x, std::int64_t y) const {
    const Span &row = rows[static_cast<std::size_t>(y)], &column = columns[static_cast<std::size_t>(x)];
    return static_cast<int>(row.first <= x) + static_cast<int>(x <= row.last) +
           static_cast<int>(column.first <= y) + static_cast<int>(y <= column.last);
  }
};

}  // namespace

Mask find_body_mask(const Volume& volume) {
  Mask body = between(volume, kBody_hu, 32767);
  const SliceMorphology& morphology = slice_morphology();
  const StructuringElement square = opening_square(body.geometry);
  const Index3 size = body.geometry.size;
  parallel_for(size.z, [&](std::int64_t z) { morphology.open(slice_of(body, z), square); });
  const Components components(body);
  if (components.count() == 0) {
    std::ranges::fill(body.voxels, 1);
    return body;
  }
  std::vector<std::map<int, Extent>> slices(static_cast<std::size_t>(size.z));
  for (const Components::Run& run : components.runs()) {
    if (kMaxRatio * components.voxels(run.component) < components.voxels(components.largest())) continue;
    const Index3 first = voxel_at(body.geometry, run.first);
    Extent& extent = slices[static_cast<std::size_t>(first.z)].try_emplace(run.component, size).first->second;
    extent.rows[static_cast<std::size_t>(first.y)].add(first.x, first.x + run.length - 1);
    for (std::int64_t x = first.x; x < first.x + run.length; ++x)
      extent.columns[static_cast<std::size_t>(x)].add(first.y, first.y);
  }
  parallel_for(size.z, [&](std::int64_t z) {
    for (std::int64_t y = 0; y < size.y; ++y)
      for (std::int64_t x = 0; x < size.x; ++x)
        body[{x, y, z}] =
            std::ranges::any_of(slices[static_cast<std::size_t>(z)],
                                [&](const auto& component) { return component.second.sides(x, y) >= 3; });
  });
  // The opening removed ears and folds of skin, too.
  parallel_for(size.z, [&](std::int64_t z) { morphology.dilate(slice_of(body, z), square); });
  return body;
}

}  // namespace xraycast
