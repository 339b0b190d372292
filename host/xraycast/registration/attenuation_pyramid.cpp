#include "xraycast/registration/attenuation_pyramid.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"

#include <glm/common.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>

namespace xraycast {
namespace {

/// The number by which Opacity::paper() gives a mu.
std::int16_t paper_hu(double mu_per_mm) {
  const double per_water = mu_per_mm / Opacity::paper().mu_per_mm(0);
  return static_cast<std::int16_t>(
      std::clamp<double>(std::round(1024 * (per_water - 1)), kPaddingHu, kMaxHu));
}

/// Those numbers by CT number, from kPaddingHu on.
std::vector<std::int16_t> table_of(const Opacity& opacity) {
  std::vector<std::int16_t> table;
  for (int hu = kPaddingHu; hu <= kMaxHu; ++hu) table.push_back(paper_hu(opacity.mu_per_mm(hu)));
  return table;
}

/// A scan's numbers for Opacity::paper(), row by row; air beyond the mask.
class PaperScan {
 public:
  PaperScan(const Volume& scan, const Opacity& opacity, std::span<const std::uint8_t> mask)
      : scan_(scan), mask_(mask), table_(table_of(opacity)) {}

  const VolumeGeometry& geometry() const { return scan_.geometry(); }

  /// `row.size()` voxels from x on.
  void copy(std::int64_t x, std::int64_t y, std::int64_t z, std::span<std::int16_t> row) const {
    const Index3& size = scan_.geometry().size;
    const auto first = static_cast<std::size_t>((z * size.y + y) * size.x + x);
    const std::int16_t* hu = scan_.hu().data() + first;
    for (std::size_t i = 0; i < row.size(); ++i)
      row[i] = table_[static_cast<std::size_t>(std::max(hu[i], kPaddingHu) - kPaddingHu)];
    if (mask_.empty()) return;
    for (std::size_t i = 0; i < row.size(); ++i)
      if (mask_[first + i] == 0) row[i] = kPaddingHu;
  }

 private:
  const Volume& scan_;
  std::span<const std::uint8_t> mask_;
  std::vector<std::int16_t> table_;
};

struct Box {
  Index3 first{std::numeric_limits<std::int64_t>::max()}, last{-1};
  bool is_empty() const { return last.x < first.x; }
  Index3 size() const { return last - first + Index3(1); }
  void include(const Index3& voxel) {
    first = glm::min(first, voxel);
    last = glm::max(last, voxel);
  }
};

/// Around what attenuates by a quarter of what water does, so that the air's noise does not count.
Box body_of(const PaperScan& scan) {
  const std::int16_t least = paper_hu(0.25 * Opacity::paper().mu_per_mm(0));
  const Index3& size = scan.geometry().size;
  Box body;
  std::mutex mutex;
  parallel_for(size.z, [&](std::int64_t z) {
    Box slice;
    std::vector<std::int16_t> row(static_cast<std::size_t>(size.x));
    for (std::int64_t y = 0; y < size.y; ++y) {
      scan.copy(0, y, z, row);
      const auto is_body = [&](std::int16_t value) { return value > least; };
      const auto first = std::ranges::find_if(row, is_body);
      if (first == row.end()) continue;
      const auto last = std::find_if(row.rbegin(), row.rend(), is_body);
      slice.include({first - row.begin(), y, z});
      slice.include({row.rend() - last - 1, y, z});
    }
    if (slice.is_empty()) return;
    const std::lock_guard lock(mutex);
    body.include(slice.first);
    body.include(slice.last);
  });
  return body;
}

/// The body's voxels.
Volume cut_out(const PaperScan& scan, const Box& body) {
  Volume volume({.size = body.size(),
                 .spacing_mm = scan.geometry().spacing_mm,
                 .origin_mm = scan.geometry().to_world_mm(body.first)},
                "the scan");
  const Index3 size = body.size();
  parallel_for(size.z, [&](std::int64_t z) {
    for (std::int64_t y = 0; y < size.y; ++y)
      scan.copy(body.first.x, body.first.y + y, body.first.z + z,
                {&volume.at(0, y, z), static_cast<std::size_t>(size.x)});
  });
  return volume;
}

/// Means over blocks of voxels; what the last blocks lack is air, and so is a voxel around all of them. Where
/// the scan cuts the body off, the attenuation thus falls over a voxel, and projections have derivatives
/// there.
Volume averaged(const Volume& fine, const Index3& block) {
  const VolumeGeometry& from = fine.geometry();
  const Index3 size = (from.size + block - Index3(1)) / block;
  Volume volume({.size = size + Index3(2),
                 .spacing_mm = from.spacing_mm * glm::dvec3(block),
                 .origin_mm = from.to_world_mm(0.5 * (glm::dvec3(block) - 1.0) - glm::dvec3(block))},
                "the scan");
  const auto voxels = static_cast<std::int64_t>(block.x * block.y * block.z);
  parallel_for(size.z + 2, [&](std::int64_t slice) {
    const std::int64_t z = slice - 1;
    std::ranges::fill(
        std::span(&volume.at(0, 0, slice), static_cast<std::size_t>(volume.geometry().slice_voxels())),
        kPaddingHu);
    if (z < 0 || z == size.z) return;
    std::vector<std::int64_t> sums(static_cast<std::size_t>(size.x));  // above air
    for (std::int64_t y = 0; y < size.y; ++y) {
      if (voxels == 1) {
        std::copy_n(fine.hu().data() + (z * size.y + y) * size.x, size.x, &volume.at(1, y + 1, slice));
        continue;
      }
      std::ranges::fill(sums, 0);
      for (std::int64_t k = z * block.z; k < std::min((z + 1) * block.z, from.size.z); ++k)
        for (std::int64_t j = y * block.y; j < std::min((y + 1) * block.y, from.size.y); ++j) {
          const std::int16_t* row = fine.hu().data() + (k * from.size.y + j) * from.size.x;
          for (std::int64_t x = 0; x < size.x; ++x) {
            const std::int64_t end = std::min((x + 1) * block.x, from.size.x);
            std::int32_t sum = 0;
            for (std::int64_t i = x * block.x; i < end; ++i) sum += row[i] - kPaddingHu;
            sums[static_cast<std::size_t>(x)] += sum;
          }
        }
      for (std::int64_t x = 0; x < size.x; ++x)
        volume.at(x + 1, y + 1, slice) = static_cast<std::int16_t>(
            kPaddingHu + (2 * sums[static_cast<std::size_t>(x)] + voxels) / (2 * voxels));
    }
  });
  return volume;
}

Index3 block_for(double spacing_mm, const VolumeGeometry& scan) {
  return glm::max(Index3(glm::round(spacing_mm / scan.spacing_mm)), Index3(1));
}

}  // namespace

AttenuationPyramid::AttenuationPyramid(ComputeDevice& device, const Volume& scan, const Opacity& opacity,
                                       std::span<const std::uint8_t> mask,
                                       std::span<const double> spacings_mm, Progress& progress) {
  const PaperScan numbers(scan, opacity, mask);
  progress.begin("averaging", static_cast<std::int64_t>(spacings_mm.size()) + 1, "levels");
  const CancelScope scope(progress);
  const Box body = body_of(numbers);
  if (body.is_empty()) throw InputError("nothing in the scan attenuates X-rays by this opacity");
  const Volume fine = cut_out(numbers, body);
  progress.advance();
  lower_mm_ = fine.geometry().lower_mm();
  upper_mm_ = fine.geometry().upper_mm();
  for (const double spacing_mm : spacings_mm) {
    levels_.push_back(upload(device, averaged(fine, block_for(spacing_mm, fine.geometry()))));
    progress.advance();
  }
}

}  // namespace xraycast
