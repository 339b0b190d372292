#include "xraycast/mask/distance_transform.hpp"

#include "xraycast/base/parallel.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace xraycast {
namespace {

/// Lower envelope of the parabolas that stand on a line of squared distances.
class Envelope {
 public:
  explicit Envelope(std::int64_t size)
      : feet_(static_cast<std::size_t>(size)),
        from_(static_cast<std::size_t>(size) + 1),
        heights_(static_cast<std::size_t>(size)) {}

  /// Replaces the line's values by min over j of (value[j] + (spacing * (i - j))^2).
  void apply(float* line, std::int64_t size, std::int64_t stride, double spacing_mm) {
    constexpr double kNever = std::numeric_limits<double>::infinity();
    const double scale = spacing_mm * spacing_mm;
    std::int64_t last = -1;
    for (std::int64_t i = 0; i < size; ++i) {
      const double height = line[i * stride];
      heights_[static_cast<std::size_t>(i)] = height;
      if (height == kNever) continue;
      double meet = -kNever;
      for (; last >= 0; --last) {
        const auto foot = feet_[static_cast<std::size_t>(last)];
        const auto j = static_cast<double>(foot), k = static_cast<double>(i);
        meet = ((height - heights_[static_cast<std::size_t>(foot)]) / scale + k * k - j * j) / (2 * (k - j));
        if (meet > from_[static_cast<std::size_t>(last)]) break;
      }
      ++last;
      feet_[static_cast<std::size_t>(last)] = i;
      from_[static_cast<std::size_t>(last)] = last == 0 ? -kNever : meet;
    }
    if (last < 0) return;
    from_[static_cast<std::size_t>(last) + 1] = kNever;
    std::size_t piece = 0;
    for (std::int64_t i = 0; i < size; ++i) {
      while (from_[piece + 1] < static_cast<double>(i)) ++piece;
      const auto away = static_cast<double>(i - feet_[piece]);
      line[i * stride] =
          static_cast<float>(heights_[static_cast<std::size_t>(feet_[piece])] + scale * away * away);
    }
  }

 private:
  std::vector<std::int64_t> feet_;
  std::vector<double> from_, heights_;
};

/// For each position of a row, whether any of `rows` rows, `stride` apart, holds something but zero there.
std::vector<std::uint8_t> occupied(const float* first, std::int64_t length, std::int64_t rows,
                                   std::int64_t stride) {
  std::vector<std::uint8_t> result(static_cast<std::size_t>(length));
  for (std::int64_t row = 0; row < rows; ++row)
    for (std::int64_t i = 0; i < length; ++i)
      result[static_cast<std::size_t>(i)] |= static_cast<std::uint8_t>(first[row * stride + i] != 0);
  return result;
}

}  // namespace

std::vector<float> distance_to_background_mm(const Mask& mask) {
  constexpr float kNever = std::numeric_limits<float>::infinity();
  const Index3 size = mask.geometry.size;
  const glm::dvec3 spacing_mm = mask.geometry.spacing_mm;
  std::vector<float> squared(mask.voxels.size());
  const std::int64_t slice = mask.geometry.slice_voxels();
  // Lines that are all background, which are most, are skipped: their distances are zero.
  parallel_for(size.z, [&](std::int64_t z) {
    Envelope along_x(size.x), along_y(size.y);
    float* first = &squared[static_cast<std::size_t>(z * slice)];
    const std::uint8_t* inside = &mask.voxels[static_cast<std::size_t>(z * slice)];
    for (std::int64_t i = 0; i < slice; ++i) first[i] = inside[i] != 0 ? kNever : 0;
    for (std::int64_t y = 0; y < size.y; ++y)
      if (std::memchr(inside + y * size.x, 1, static_cast<std::size_t>(size.x)) != nullptr)
        along_x.apply(first + y * size.x, size.x, 1, spacing_mm.x);
    const auto columns = occupied(first, size.x, size.y, size.x);
    for (std::int64_t x = 0; x < size.x; ++x)
      if (columns[static_cast<std::size_t>(x)] != 0) along_y.apply(first + x, size.y, size.x, spacing_mm.y);
  });
  const auto diagonal_mm = static_cast<float>(glm::length(spacing_mm * glm::dvec3(size)));
  parallel_for(size.y, [&](std::int64_t y) {
    Envelope along_z(size.z);
    float* plane = &squared[static_cast<std::size_t>(y * size.x)];
    const auto lines = occupied(plane, size.x, size.z, slice);
    for (std::int64_t x = 0; x < size.x; ++x) {
      if (lines[static_cast<std::size_t>(x)] == 0) continue;
      float* line = plane + x;
      along_z.apply(line, size.z, slice, spacing_mm.z);
      for (std::int64_t z = 0; z < size.z; ++z)
        line[z * slice] = line[z * slice] == kNever ? diagonal_mm : std::sqrt(line[z * slice]);
    }
  });
  return squared;
}

std::vector<float> distance_to_foreground_mm(Mask mask) {
  for (std::uint8_t& voxel : mask.voxels) voxel ^= 1;
  return distance_to_background_mm(mask);
}

std::vector<std::size_t> deepest_first(const Mask& mask, const std::vector<float>& distance_mm) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < mask.voxels.size(); ++i)
    if (mask.voxels[i] != 0) order.push_back(i);
  std::ranges::stable_sort(order,
                           [&](std::size_t a, std::size_t b) { return distance_mm[a] > distance_mm[b]; });
  return order;
}

}  // namespace xraycast
