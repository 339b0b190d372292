#include "xraycast/lesions/edited_scan.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/mask/trilinear.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

namespace xraycast {
namespace {

/// A part of a scan's grid with numbers of its voxels, x fastest.
struct Part {
  Box box;
  Index3 size() const { return box.upper - box.lower; }
  std::size_t count() const { return static_cast<std::size_t>(size().x * size().y * size().z); }
  std::size_t at(const Index3& voxel) const {
    const Index3 i = voxel - box.lower, n = size();
    return static_cast<std::size_t>((i.z * n.y + i.y) * n.x + i.x);
  }
};

using Numbers = std::vector<float>;

// ---- blur -----------------------------------------------------------------------------------------------

std::vector<float> gaussian(double sigma_vox) {
  const int reach = static_cast<int>(std::ceil(3 * sigma_vox));
  std::vector<float> weights;
  float sum = 0;
  for (int i = -reach; i <= reach; ++i) {
    weights.push_back(static_cast<float>(std::exp(-0.5 * i * i / (sigma_vox * sigma_vox))));
    sum += weights.back();
  }
  for (float& weight : weights) weight /= sum;
  return weights;
}

/// Along one axis; beyond the part its border goes on.
void blur_along(Numbers& values, const Index3& size, int axis, const std::vector<float>& weights) {
  const auto reach = static_cast<std::int64_t>(weights.size() / 2), length = size[axis];
  const std::int64_t stride = axis == 0 ? 1 : axis == 1 ? size.x : size.x * size.y;
  const std::int64_t across = size[axis == 0 ? 1 : 0], planes = size[axis == 2 ? 1 : 2];
  const std::int64_t across_stride = axis == 0 ? size.x : 1,
                     plane_stride = axis == 2 ? size.x : size.x * size.y;
  parallel_for(planes, [&](std::int64_t plane) {
    std::vector<float> line(static_cast<std::size_t>(length));
    for (std::int64_t a = 0; a < across; ++a) {
      float* first = values.data() + plane * plane_stride + a * across_stride;
      for (std::int64_t i = 0; i < length; ++i) line[static_cast<std::size_t>(i)] = first[i * stride];
      for (std::int64_t i = 0; i < length; ++i) {
        float sum = 0;
        for (std::int64_t k = -reach; k <= reach; ++k)
          sum += weights[static_cast<std::size_t>(k + reach)] *
                 line[static_cast<std::size_t>(std::clamp<std::int64_t>(i + k, 0, length - 1))];
        first[i * stride] = sum;
      }
    }
  });
}

Numbers blurred(Numbers values, const Index3& size, const glm::dvec3& sigma_vox) {
  for (int axis = 0; axis < 3; ++axis)
    if (sigma_vox[axis] > 0.05) blur_along(values, size, axis, gaussian(sigma_vox[axis]));
  return values;
}

// ---- how full voxels are, with sharp walls --------------------------------------------------------------

/// How full voxels are before and after.
struct Cover {
  Numbers before, after;
};

constexpr int kCoverAcross = 4;

double fill_between(const VoxelLumen& lumen, const glm::dvec3& point_mm) {
  const VolumeGeometry& grid = lumen.mask.geometry;
  const glm::dvec3 index =
      glm::clamp(grid.to_index(point_mm), glm::dvec3(0), glm::dvec3(grid.size - Index3(1)));
  const Index3 low(glm::floor(index));
  return trilinear(lumen.mask, lumen.fill.fractions, low, index - glm::dvec3(low)) / LumenFill::kFull;
}

Cover cover_of(const VoxelLumen& lumen, const ScanChange& change, const Part& part, Progress& progress) {
  const VolumeGeometry& grid = lumen.mask.geometry;
  const double half_full = 0.5 * change.middle_fill;
  const auto is_lumen = [&](const glm::dvec3& p) { return fill_between(lumen, p) >= half_full; };
  // The share of a voxel's places that are lumen.
  const auto share_of = [&](const Index3& voxel, const auto& counts) {
    int count = 0;
    constexpr int kPlaces = kCoverAcross * kCoverAcross * kCoverAcross;
    for (int i = 0; i < kPlaces; ++i) {
      const glm::dvec3 place =
          (glm::dvec3(i % kCoverAcross, i / kCoverAcross % kCoverAcross, i / (kCoverAcross * kCoverAcross)) +
           0.5) /
              double{kCoverAcross} -
          0.5;
      count += counts(grid.to_world_mm(glm::dvec3(voxel) + place)) ? 1 : 0;
    }
    return static_cast<float>(count) / kPlaces;
  };
  const auto is_lumen_after = [&](const glm::dvec3& p) {
    const LumenSource from = change.source(p);
    using Kind = LumenSource::Kind;
    return from.kind == Kind::same    ? is_lumen(p)
           : from.kind == Kind::other ? is_lumen(from.from_mm)
                                      : from.kind == Kind::full;
  };
  Cover cover{Numbers(part.count()), {}};
  progress.begin("editing the scan", 1, "parts");
  for_each_voxel(part.box, [&](const Index3& v) { cover.before[part.at(v)] = share_of(v, is_lumen); });
  cover.after = cover.before;
  const std::vector<Box> blocks = changing_blocks(grid, part.box, change.source);
  progress.begin("editing the scan", std::ssize(blocks), "blocks");
  parallel_for(std::ssize(blocks), [&](std::int64_t b) {
    for_each_voxel_of(blocks[static_cast<std::size_t>(b)],
                      [&](const Index3& v) { cover.after[part.at(v)] = share_of(v, is_lumen_after); });
    progress.advance();
  });
  return cover;
}

// ---- what the scan shows --------------------------------------------------------------------------------

/// A line through points by least squares, without those that lie far off it.
struct RobustLine {
  double level, rise, error;
};

RobustLine fitted_line(const std::vector<double>& x, const std::vector<double>& y) {
  RobustLine line{0, 0, std::numeric_limits<double>::infinity()};
  double limit = std::numeric_limits<double>::infinity();
  for (int pass = 0; pass < 4; ++pass) {
    double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (pass > 0 && std::abs(y[i] - line.level - line.rise * x[i]) > limit) continue;
      n += 1, sx += x[i], sy += y[i], sxx += x[i] * x[i], sxy += x[i] * y[i];
    }
    const double spread = n * sxx - sx * sx;
    if (!(spread > 1e-9)) break;
    line.rise = (n * sxy - sx * sy) / spread;
    line.level = (sy - line.rise * sx) / n;
    std::vector<double> away;
    for (std::size_t i = 0; i < x.size(); ++i) away.push_back(std::abs(y[i] - line.level - line.rise * x[i]));
    const auto middle = away.begin() + static_cast<std::ptrdiff_t>(away.size() / 2);
    std::nth_element(away.begin(), middle, away.end());
    constexpr double kDeviationOfMedian = 1.4826;  // of normal deviates
    limit = std::max(1.0, 3 * kDeviationOfMedian * *middle);
    double sum = 0;
    for (const double mm : away) sum += std::min(mm, limit) * std::min(mm, limit);
    line.error = sum / static_cast<double>(away.size());
  }
  return line;
}

/// The slices of a part around the one with most lumen, at most so many.
Part fullest_slab(const Part& part, const Numbers& before) {
  constexpr std::int64_t kHalf = 40;
  const auto slice = static_cast<std::ptrdiff_t>(part.size().x * part.size().y);
  std::int64_t fullest = 0;
  double most = -1;
  for (std::int64_t z = 0; z < part.size().z; ++z) {
    const auto first = before.begin() + z * slice;
    if (const double sum = std::accumulate(first, first + slice, 0.0); sum > most) most = sum, fullest = z;
  }
  Part slab = part;
  slab.box.lower.z = part.box.lower.z + std::max<std::int64_t>(fullest - kHalf, 0);
  slab.box.upper.z = std::min(part.box.upper.z, part.box.lower.z + fullest + kHalf + 1);
  return slab;
}

Numbers slab_of(const Numbers& values, const Part& part, const Part& slab) {
  const auto first = values.begin() + static_cast<std::ptrdiff_t>(part.at(slab.box.lower));
  return {first, first + static_cast<std::ptrdiff_t>(slab.count())};
}

/// Tissue, lumen and blur by which the lumen explains the scan best.
ScanMatch matched(const Numbers& all_hu, const Numbers& all_before, const Part& part,
                  const glm::dvec3& spacing_mm) {
  const Part slab = fullest_slab(part, all_before);
  const Numbers hu = slab_of(all_hu, part, slab), before = slab_of(all_before, part, slab);
  constexpr double kAround_mm = 1.5, kNear = 0.02;  // within some 3 mm of the wall
  const Numbers near = blurred(before, slab.size(), kAround_mm / spacing_mm);
  std::vector<std::size_t> counted;
  for (std::size_t i = 0; i < near.size(); ++i)
    if (near[i] > kNear) counted.push_back(i);
  constexpr std::size_t kMostCounted = 200'000;
  const std::size_t stride = counted.size() / kMostCounted + 1;
  ScanMatch best{0, 0, 0};
  double least = std::numeric_limits<double>::infinity();
  for (int step = 0; step <= 16; ++step) {
    const double blur_mm = 0.1 * step;
    const Numbers model = blurred(before, slab.size(), blur_mm / spacing_mm);
    std::vector<double> x, y;
    for (std::size_t c = 0; c < counted.size(); c += stride)
      x.push_back(model[counted[c]]), y.push_back(hu[counted[c]]);
    const RobustLine line = fitted_line(x, y);
    if (line.error < least) {
      least = line.error;
      best = {line.level, line.level + line.rise, blur_mm};
    }
  }
  return best;
}

/// The box with what blur reaches around.
Part part_around(const VolumeGeometry& grid, const BoxMm& box_mm) {
  constexpr double kMargin_mm = 6;
  return {{glm::max(Index3(glm::floor(grid.to_index(box_mm.first - kMargin_mm))), Index3(0)),
           glm::min(Index3(glm::ceil(grid.to_index(box_mm.second + kMargin_mm))) + Index3(1), grid.size)}};
}

}  // namespace

ScanMatch change_scan(Volume& scan, const VoxelLumen& lumen, const ScanChange& change, double noise_hu,
                      Progress& progress) {
  const VolumeGeometry& grid = scan.geometry();
  const Part part = part_around(grid, change.box_mm);
  if (part.box.empty()) return {0, 0, 0};
  constexpr std::size_t kMost = 80'000'000;  // ten numbers a voxel
  if (part.count() > kMost)
    throw InputError(
        "the edits change {} million voxels of the scan, more than {}; scale fewer branches at once",
        part.count() / 1'000'000, kMost / 1'000'000);
  Numbers hu(part.count());
  for_each_voxel(part.box, [&](const Index3& v) { hu[part.at(v)] = scan.at(v.x, v.y, v.z); });
  const Cover cover = cover_of(lumen, change, part, progress);
  const ScanMatch match = matched(hu, cover.before, part, grid.spacing_mm);
  const double wall_hu = change.wall_hu.value_or(match.tissue_hu);
  const glm::dvec3 blur_vox = match.blur_mm / grid.spacing_mm;

  Numbers gained(part.count()), step_hu(part.count());
  for (std::size_t i = 0; i < part.count(); ++i) {
    const float more = cover.after[i] - cover.before[i];
    gained[i] = std::max(more, 0.0F);
    step_hu[i] = static_cast<float>(more > 0 ? more * (match.lumen_hu - match.tissue_hu)
                                             : more * (match.lumen_hu - wall_hu));
  }
  gained = blurred(std::move(gained), part.size(), blur_vox);
  step_hu = blurred(std::move(step_hu), part.size(), blur_vox);
  const Numbers before = blurred(cover.before, part.size(), blur_vox);
  Numbers rest(part.count());  // noise, and what else is there
  for (std::size_t i = 0; i < part.count(); ++i)
    rest[i] = static_cast<float>(hu[i] - match.tissue_hu - (match.lumen_hu - match.tissue_hu) * before[i]);
  constexpr double kStructure_vox = 3;  // noise is finer
  const Numbers structure = blurred(rest, part.size(), glm::dvec3(kStructure_vox));

  const auto most_hu = static_cast<float>(3 * noise_hu);
  for_each_voxel(part.box, [&](const Index3& v) {
    const std::size_t i = part.at(v);
    const float noise = std::clamp(rest[i] - structure[i], -most_hu, most_hu);
    const float now = hu[i] + step_hu[i] + gained[i] * (noise - rest[i]);
    constexpr float kLeast_hu = 0.5F;
    if (std::abs(now - hu[i]) >= kLeast_hu)
      scan.at(v.x, v.y, v.z) = static_cast<std::int16_t>(
          std::lround(std::clamp(now, static_cast<float>(kPaddingHu), static_cast<float>(kMaxHu))));
  });
  return match;
}

}  // namespace xraycast
