#include "xraycast/volume/resample.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/volume/rescale.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <thread>

namespace xraycast {
namespace {

constexpr double kNoWeight = 1e-6;

/// The straight line of stored indices that a row of output voxels follows through a slice.
struct Track {
  double i, i_step, j, j_step;
};

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

/// Bilinear; NaN beyond the slice's outer voxel faces.
double sample(const std::int16_t* slice, std::int64_t columns, std::int64_t rows, double i, double j) {
  if (!(i >= -0.5 && i <= static_cast<double>(columns) - 0.5 && j >= -0.5 &&
        j <= static_cast<double>(rows) - 0.5))
    return kNothing;
  i = std::clamp(i, 0.0, static_cast<double>(columns - 1));
  j = std::clamp(j, 0.0, static_cast<double>(rows - 1));
  const auto i0 = static_cast<std::int64_t>(i), j0 = static_cast<std::int64_t>(j);
  const std::int64_t right = i0 + 1 < columns ? 1 : 0, below = j0 + 1 < rows ? columns : 0;
  const double fi = i - static_cast<double>(i0), fj = j - static_cast<double>(j0);
  const std::int16_t* at = slice + j0 * columns + i0;
  const double upper = at[0] + fi * (at[right] - at[0]);
  const double lower = at[below] + fi * (at[below + right] - at[below]);
  return upper + fj * (lower - upper);
}

class ResampledSource final : public SliceSource {
 public:
  ResampledSource(std::unique_ptr<SliceStack> stack, const VolumeGeometry& grid)
      : stack_(std::move(stack)), grid_(grid) {
    const SlicePlane& first = stack_->planes.front();
    normal_ = upward(glm::normalize(glm::cross(first.i_step_mm, first.j_step_mm)));
    for (const SlicePlane& plane : stack_->planes) {
      heights_mm_.push_back(glm::dot(plane.origin_mm, normal_));
      // The dual basis: its dot product with a way in the plane counts the voxel steps along it.
      const glm::dvec3 cross = glm::cross(plane.i_step_mm, plane.j_step_mm);
      i_dual_.push_back(glm::cross(plane.j_step_mm, cross) / glm::dot(cross, cross));
      j_dual_.push_back(glm::cross(cross, plane.i_step_mm) / glm::dot(cross, cross));
    }
    const std::size_t n = heights_mm_.size();
    lower_margin_mm_ = 0.5 * (n > 1 ? heights_mm_[1] - heights_mm_[0] : stack_->thickness_mm);
    upper_margin_mm_ = 0.5 * (n > 1 ? heights_mm_[n - 1] - heights_mm_[n - 2] : stack_->thickness_mm);
  }

  const VolumeGeometry& geometry() const override { return grid_; }
  HuRange hu_range() const override { return stack_->hu_range(); }

  std::int64_t read(std::span<std::int16_t> hu, Progress& progress) override {
    // As many slices at a time as there are cores: more would only widen the window.
    const auto cores = std::max<std::int64_t>(1, std::thread::hardware_concurrency());
    const std::int64_t voxels = grid_.slice_voxels();
    const std::int64_t count = std::min(static_cast<std::int64_t>(hu.size()) / voxels, grid_.size.z - next_);
    for (std::int64_t done = 0; done < count;) {
      const std::int64_t batch = std::min(cores, count - done);
      slide_window(next_, next_ + batch - 1);
      parallel_for(batch * grid_.size.y, [&](std::int64_t row) {
        fill_row(row % grid_.size.y, next_ + row / grid_.size.y,
                 hu.data() + done * voxels + row * grid_.size.x);
      });
      next_ += batch;
      done += batch;
      progress.advance(batch);
    }
    return count;
  }

 private:
  /// Index of the stored slice at or below a height; of the last but one for the last, so that there is one
  /// above.
  std::int64_t slice_below(double height_mm) const {
    const auto above = std::ranges::upper_bound(heights_mm_, height_mm) - heights_mm_.begin();
    return std::clamp<std::int64_t>(above - 1, 0, std::max<std::int64_t>(0, std::ssize(heights_mm_) - 2));
  }

  /// Keeps the stored slices that output slices z0 to z1 need, and decodes those that are not there yet.
  /// Where the normal rises with z those below are never needed again; where it falls (it may, for coronal
  /// and sagittal slices) all are kept.
  void slide_window(std::int64_t z0, std::int64_t z1) {
    double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
    for (int corner = 0; corner < 8; ++corner) {
      const glm::dvec3 index(corner & 1 ? grid_.size.x - 1 : 0, corner & 2 ? grid_.size.y - 1 : 0,
                             corner & 4 ? z1 : z0);
      const double height = glm::dot(grid_.to_world_mm(index), normal_);
      lowest = std::min(lowest, height);
      highest = std::max(highest, height);
    }
    const auto slices = static_cast<std::int64_t>(stack_->planes.size());
    // All slices are decoded, also those that no output slice needs: they count for the range of HU.
    const std::int64_t end = z1 == grid_.size.z - 1 ? slices : std::min(slices, slice_below(highest) + 2);
    std::vector<std::int16_t*> fresh;
    for (std::int64_t k = window_end_; k < end; ++k) {
      window_.emplace_back(static_cast<std::size_t>(stack_->columns * stack_->rows));
      fresh.push_back(window_.back().data());
    }
    if (!fresh.empty()) stack_->decode(window_end_, fresh);
    window_end_ = std::max(window_end_, end);
    const std::int64_t begin = normal_.z > 0 ? slice_below(lowest) : 0;
    while (window_end_ - std::ssize(window_) < begin) window_.pop_front();
  }

  Track track(std::int64_t k, const glm::dvec3& start_mm) const {
    const auto plane = static_cast<std::size_t>(k);
    const glm::dvec3 way = start_mm - stack_->planes[plane].origin_mm;
    return {glm::dot(way, i_dual_[plane]), grid_.spacing_mm.x * i_dual_[plane].x,
            glm::dot(way, j_dual_[plane]), grid_.spacing_mm.x * j_dual_[plane].x};
  }

  void fill_row(std::int64_t y, std::int64_t z, std::int16_t* out) const {
    const std::int64_t columns = stack_->columns, rows = stack_->rows, slices = std::ssize(heights_mm_);
    const glm::dvec3 start_mm = grid_.to_world_mm({0, y, z});
    const double start_height = glm::dot(start_mm, normal_), height_step = grid_.spacing_mm.x * normal_.x;
    std::int64_t below = -1;
    Track lower_track{}, upper_track{};
    for (std::int64_t x = 0; x < grid_.size.x; ++x) {
      const auto step = static_cast<double>(x);
      const double height = start_height + step * height_step;
      if (height < heights_mm_.front() - lower_margin_mm_ || height > heights_mm_.back() + upper_margin_mm_) {
        out[x] = kPaddingHu;
        continue;
      }
      const std::int64_t k = height_step == 0 && below >= 0 ? below : slice_below(height);
      const std::int64_t k_above = std::min(k + 1, slices - 1);
      if (k != below) {
        below = k;
        lower_track = track(k, start_mm);
        upper_track = track(k_above, start_mm);
      }
      const double gap = heights_mm_[k_above] - heights_mm_[k];
      double weight = gap > 0 ? std::clamp((height - heights_mm_[k]) / gap, 0.0, 1.0) : 0.0;
      // Where the grid coincides with a slice up to rounding, the other one is not needed.
      if (weight < kNoWeight || weight > 1 - kNoWeight) weight = std::round(weight);
      const double lower = weight < 1
                               ? sample(slice(k), columns, rows, lower_track.i + step * lower_track.i_step,
                                        lower_track.j + step * lower_track.j_step)
                               : 0;
      const double upper =
          weight > 0 ? sample(slice(k_above), columns, rows, upper_track.i + step * upper_track.i_step,
                              upper_track.j + step * upper_track.j_step)
                     : 0;
      // Where one of them does not extend, only the nearer one counts, or air if that is the one.
      const bool partial = std::isnan(lower) || std::isnan(upper);
      out[x] = to_hu(!partial ? lower + weight * (upper - lower) : weight < 0.5 ? lower : upper);
    }
  }

  const std::int16_t* slice(std::int64_t k) const {
    return window_[static_cast<std::size_t>(k - (window_end_ - std::ssize(window_)))].data();
  }

  std::unique_ptr<SliceStack> stack_;
  VolumeGeometry grid_;
  glm::dvec3 normal_;
  std::vector<double> heights_mm_;  ///< of the stored slices, along the normal
  std::vector<glm::dvec3> i_dual_, j_dual_;
  double lower_margin_mm_, upper_margin_mm_;  ///< how far the outermost slices reach

  std::deque<std::vector<std::int16_t>> window_;  ///< decoded slices up to window_end_ - 1
  std::int64_t window_end_ = 0;
  std::int64_t next_ = 0;
};

}  // namespace

std::unique_ptr<SliceSource> resample(std::unique_ptr<SliceStack> stack, const VolumeGeometry& grid) {
  return std::make_unique<ResampledSource>(std::move(stack), grid);
}

}  // namespace xraycast
