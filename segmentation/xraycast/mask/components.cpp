#include "xraycast/mask/components.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/base/union_find.hpp"

#include <algorithm>
#include <cstring>

namespace xraycast {
namespace {

/// The runs of one row, in order.
void find_runs(const std::uint8_t* row, std::int64_t first, std::int64_t size,
               std::vector<Components::Run>& runs) {
  for (std::int64_t x = 0; x < size;) {
    const void* begin = std::memchr(row + x, 1, static_cast<std::size_t>(size - x));
    if (begin == nullptr) return;
    x = static_cast<const std::uint8_t*>(begin) - row;
    const std::int64_t start = x;
    while (x < size && row[x] != 0) ++x;
    runs.push_back({first + start, static_cast<std::int32_t>(x - start), -1});
  }
}

}  // namespace

Components::Components(const Mask& mask) : geometry_(mask.geometry) {
  const Index3 size = geometry_.size;
  const std::int64_t rows = size.y * size.z;
  std::vector<std::vector<Run>> of_slice(static_cast<std::size_t>(size.z));
  row_ends_.resize(static_cast<std::size_t>(rows));
  parallel_for(size.z, [&](std::int64_t z) {
    auto& runs = of_slice[static_cast<std::size_t>(z)];
    for (std::int64_t y = 0; y < size.y; ++y) {
      const std::size_t first = mask.offset({0, y, z});
      find_runs(&mask.voxels[first], static_cast<std::int64_t>(first), size.x, runs);
      row_ends_[static_cast<std::size_t>(z * size.y + y)] = runs.size();
    }
  });
  for (std::int64_t z = 0; z < size.z; ++z) {
    const auto& runs = of_slice[static_cast<std::size_t>(z)];
    for (std::int64_t y = 0; y < size.y; ++y)
      row_ends_[static_cast<std::size_t>(z * size.y + y)] += runs_.size();
    runs_.insert(runs_.end(), runs.begin(), runs.end());
  }

  // Two runs of neighbouring rows touch when they overlap after one of them grew by a voxel at each end.
  // A set is represented by its first run, so that components are numbered in the order of their runs.
  UnionFind sets(runs_.size());
  const auto row_begin = [&](std::int64_t row) {
    return row == 0 ? 0 : row_ends_[static_cast<std::size_t>(row - 1)];
  };
  const auto join_rows = [&](std::int64_t row, std::int64_t other) {
    std::size_t i = row_begin(row), k = row_begin(other);
    const std::size_t i_end = row_ends_[static_cast<std::size_t>(row)],
                      k_end = row_ends_[static_cast<std::size_t>(other)];
    const std::int64_t shift = (row - other) * size.x;
    while (i < i_end && k < k_end) {
      const std::int64_t a = runs_[i].first, a_end = a + runs_[i].length, b = runs_[k].first + shift,
                         b_end = b + runs_[k].length;
      if (a <= b_end && b <= a_end) {
        const auto [first, second] = std::minmax({sets.find(i), sets.find(k)});
        sets.unite(first, second);
      }
      if (a_end < b_end)
        ++i;
      else
        ++k;
    }
  };
  for (std::int64_t z = 0; z < size.z; ++z)
    for (std::int64_t y = 0; y < size.y; ++y) {
      const std::int64_t row = z * size.y + y;
      if (row_begin(row) == row_ends_[static_cast<std::size_t>(row)]) continue;
      if (y > 0) join_rows(row, row - 1);
      if (z == 0) continue;
      for (std::int64_t dy = -1; dy <= 1; ++dy)
        if (y + dy >= 0 && y + dy < size.y) join_rows(row, row - size.y + dy);
    }

  for (std::size_t i = 0; i < runs_.size(); ++i) {
    const std::size_t representative = sets.find(i);  // never after i
    if (representative == i) {
      runs_[i].component = static_cast<std::int32_t>(voxels_.size());
      voxels_.push_back(0);
    } else {
      runs_[i].component = runs_[representative].component;
    }
    voxels_[static_cast<std::size_t>(runs_[i].component)] += runs_[i].length;
  }
}

int Components::largest() const {
  return voxels_.empty() ? -1 : static_cast<int>(std::ranges::max_element(voxels_) - voxels_.begin());
}

int Components::at(const Index3& index) const {
  const std::int64_t row = index.z * geometry_.size.y + index.y, offset = row * geometry_.size.x + index.x;
  const auto begin = runs_.begin() +
                     static_cast<std::ptrdiff_t>(row == 0 ? 0 : row_ends_[static_cast<std::size_t>(row - 1)]),
             end = runs_.begin() + static_cast<std::ptrdiff_t>(row_ends_[static_cast<std::size_t>(row)]);
  for (auto run = begin; run != end; ++run)
    if (offset >= run->first && offset < run->first + run->length) return run->component;
  return -1;
}

Mask Components::select(const std::vector<bool>& keep) const {
  Mask mask(geometry_);
  for (const Run& run : runs_)
    if (keep[static_cast<std::size_t>(run.component)])
      std::fill_n(mask.voxels.begin() + run.first, run.length, std::uint8_t{1});
  return mask;
}

Mask without_small_components(const Mask& mask) {
  const Components components(mask);
  if (components.count() == 0) return mask;
  std::vector<bool> keep(static_cast<std::size_t>(components.count()));
  for (int c = 0; c < components.count(); ++c)
    keep[static_cast<std::size_t>(c)] = 100 * components.voxels(c) >= components.voxels(components.largest());
  return components.select(keep);
}

}  // namespace xraycast
