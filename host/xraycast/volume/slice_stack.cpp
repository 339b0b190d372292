#include "xraycast/volume/slice_stack.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/volume/bodily_geometry.hpp"
#include "xraycast/volume/resample.hpp"
#include "xraycast/volume/rescale.hpp"

#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace xraycast {
namespace {

/// A stack counts as lying on a grid while none of its voxels is further off than this share of one.
constexpr double kOffGrid = 0.1;
/// A gap counts as uneven when it differs from the median by more than this share of it.
constexpr double kUneven = 0.01;

int main_axis(const glm::dvec3& v) {
  const glm::dvec3 a = glm::abs(v);
  return a.z >= a.x && a.z >= a.y ? 2 : a.y >= a.x ? 1 : 0;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// A distance worked out from positions, or the one that the file states where they differ by rounding only.
double stated_or(double mm, double stated_mm) {
  return std::abs(mm - stated_mm) < 1e-6 * mm ? stated_mm : mm;
}

glm::dvec3 centre_mm(const SliceStack& stack, const SlicePlane& plane) {
  return plane.origin_mm + 0.5 * static_cast<double>(stack.columns - 1) * plane.i_step_mm +
         0.5 * static_cast<double>(stack.rows - 1) * plane.j_step_mm;
}

/// Centres of a slice's corner voxels.
std::array<glm::dvec3, 4> corners_mm(const SliceStack& stack, const SlicePlane& plane) {
  const glm::dvec3 i = static_cast<double>(stack.columns - 1) * plane.i_step_mm;
  const glm::dvec3 j = static_cast<double>(stack.rows - 1) * plane.j_step_mm;
  return {plane.origin_mm, plane.origin_mm + i, plane.origin_mm + j, plane.origin_mm + i + j};
}

/// Properties of the whole stack from the planes' positions.
struct Layout {
  glm::dvec3 normal;            ///< unit length
  double i_mm, j_mm, k_mm;      ///< median steps along row, column and normal
  std::vector<double> gaps_mm;  ///< along the normal, one between each slice and the next
  double tilt_rad;              ///< between the normal and the direction from slice to slice
  std::array<int, 3> axes;      ///< patient axis that row, column and stack lie nearest to
};

Layout layout_of(const SliceStack& stack) {
  const SlicePlane& first = stack.planes.front();
  const glm::dvec3 cross = glm::cross(first.i_step_mm, first.j_step_mm);
  // Written so that values that are not numbers are refused as well.
  if (!(glm::length(cross) > 1e-6 * glm::length(first.i_step_mm) * glm::length(first.j_step_mm)))
    throw InputError(
        "{}: pixel spacing and orientation do not span a plane; a spacing is zero or the direction "
        "matrix is singular",
        stack.name);
  Layout layout;
  layout.normal = upward(glm::normalize(cross));

  std::vector<double> i_mm, j_mm, tilts_rad;
  for (const SlicePlane& plane : stack.planes) {
    i_mm.push_back(glm::length(plane.i_step_mm));
    j_mm.push_back(glm::length(plane.j_step_mm));
  }
  for (std::size_t k = 1; k < stack.planes.size(); ++k) {
    const glm::dvec3 step = centre_mm(stack, stack.planes[k]) - centre_mm(stack, stack.planes[k - 1]);
    const double gap = glm::dot(step, layout.normal);
    layout.gaps_mm.push_back(gap);
    tilts_rad.push_back(std::atan2(glm::length(step - gap * layout.normal), gap));
  }
  layout.i_mm = median(i_mm);
  layout.j_mm = median(j_mm);
  layout.k_mm =
      layout.gaps_mm.empty() ? stack.thickness_mm : stated_or(median(layout.gaps_mm), stack.thickness_mm);
  // The median, so that a reconstruction centre moved between two slices does not count as a tilt.
  layout.tilt_rad = tilts_rad.empty() ? 0 : median(tilts_rad);
  if (!(layout.k_mm > 0))
    throw InputError("{}: a single slice without a thickness; give the folder that holds the whole series",
                     stack.name);

  const int k_axis = main_axis(layout.normal);
  glm::dvec3 i_direction = first.i_step_mm;
  i_direction[k_axis] = 0;
  const int i_axis = main_axis(i_direction);
  layout.axes = {i_axis, 3 - i_axis - k_axis, k_axis};
  return layout;
}

bool is_even(double gap_mm, double median_mm) { return std::abs(gap_mm - median_mm) <= kUneven * median_mm; }

/// The smallest grid along the patient's axes, with the stack's own spacing, that covers all its voxel
/// centres.
VolumeGeometry covering_grid(const SliceStack& stack, const Layout& layout) {
  VolumeGeometry grid;
  grid.spacing_mm[layout.axes[0]] = layout.i_mm;
  grid.spacing_mm[layout.axes[1]] = layout.j_mm;
  // Between tilted slices the way along the table is longer than the way along their normal.
  grid.spacing_mm[layout.axes[2]] = layout.k_mm / std::cos(layout.tilt_rad);

  glm::dvec3 lowest(std::numeric_limits<double>::infinity()), highest = -lowest;
  for (const SlicePlane& plane : stack.planes)
    for (const glm::dvec3& corner : corners_mm(stack, plane)) {
      lowest = glm::min(lowest, corner);
      highest = glm::max(highest, corner);
    }
  grid.origin_mm = lowest;
  const glm::dvec3 steps = glm::round((highest - lowest) / grid.spacing_mm);
  for (int axis = 0; axis < 3; ++axis) {
    // Compared as a double: a damaged file's extent may not fit an integer.
    if (!(steps[axis] < 65536))
      throw InputError(
          "{}: would need a grid of {:g} x {:g} x {:g} voxels; the file's spacing or positions are damaged",
          stack.name, steps.x + 1, steps.y + 1, steps.z + 1);
    grid.size[axis] = static_cast<std::int64_t>(steps[axis]) + 1;
  }
  // A few slices that lie obliquely take a grid much larger than they are, but no scan does.
  constexpr std::int64_t kMaxGrown = 64, kLittle = std::int64_t{1} << 28;
  const std::int64_t stored = stack.columns * stack.rows * std::ssize(stack.planes);
  if (grid.voxel_count() > std::max(kLittle, kMaxGrown * stored))
    throw InputError(
        "{}: {} voxels would need a grid of {} x {} x {}; the file's spacing or positions are damaged",
        stack.name, stored, grid.size.x, grid.size.y, grid.size.z);
  // Slices that are even up to rounding keep both ends.
  const auto slices = static_cast<std::int64_t>(stack.planes.size());
  const int k_axis = layout.axes[2];
  const bool even =
      std::ranges::all_of(layout.gaps_mm, [&](double gap) { return is_even(gap, layout.k_mm); });
  if (even && slices > 1 && grid.size[k_axis] == slices)
    grid.spacing_mm[k_axis] =
        stated_or((highest - lowest)[k_axis] / static_cast<double>(slices - 1), stack.thickness_mm);
  return grid;
}

/// Whether the stack's voxels are the grid's, reversed and exchanged axes allowed.
bool lies_on(const VolumeGeometry& grid, const SliceStack& stack, const Layout& layout) {
  const auto [i_axis, j_axis, k_axis] = layout.axes;
  if (grid.size[i_axis] != stack.columns || grid.size[j_axis] != stack.rows ||
      grid.size[k_axis] != static_cast<std::int64_t>(stack.planes.size()))
    return false;
  for (const SlicePlane& plane : stack.planes) {
    const std::array<glm::dvec3, 4> corners = corners_mm(stack, plane);
    // Along the normal slices may drift within kUneven, but must not lean.
    const double k_index = grid.to_index(centre_mm(stack, plane))[k_axis];
    for (int corner = 0; corner < 4; ++corner) {
      const bool far_i = (corner & 1) != (plane.i_step_mm[i_axis] < 0);
      const bool far_j = (corner & 2) / 2 != (plane.j_step_mm[j_axis] < 0);
      glm::dvec3 index;
      index[i_axis] = far_i ? static_cast<double>(stack.columns - 1) : 0;
      index[j_axis] = far_j ? static_cast<double>(stack.rows - 1) : 0;
      index[k_axis] = k_index;
      const glm::dvec3 off = glm::abs(grid.to_index(corners[static_cast<std::size_t>(corner)]) - index);
      if (off.x > kOffGrid || off.y > kOffGrid || off.z > kOffGrid) return false;
    }
  }
  return true;
}

/// Slices that become axial ones of the patient's frame by flipping rows or columns, or by transposing.
class AlignedSource final : public SliceSource {
 public:
  AlignedSource(std::unique_ptr<SliceStack> stack, const VolumeGeometry& geometry)
      : stack_(std::move(stack)),
        geometry_(geometry),
        transposed_(main_axis(stack_->planes.front().i_step_mm) == 1),
        // After a transposition the stored rows run along x.
        flip_x_((transposed_ ? stack_->planes.front().j_step_mm : stack_->planes.front().i_step_mm).x < 0),
        flip_y_((transposed_ ? stack_->planes.front().i_step_mm : stack_->planes.front().j_step_mm).y < 0) {}

  const VolumeGeometry& geometry() const override { return geometry_; }
  HuRange hu_range() const override { return stack_->hu_range(); }

  std::int64_t read(std::span<std::int16_t> hu, Progress& progress) override {
    // Small enough for a smooth progress bar, large enough for all cores.
    constexpr std::int64_t kBatch = 16;
    const std::int64_t voxels = geometry_.slice_voxels();
    const std::int64_t count =
        std::min(static_cast<std::int64_t>(hu.size()) / voxels, geometry_.size.z - next_);
    for (std::int64_t done = 0; done < count;) {
      const std::int64_t batch = std::min(kBatch, count - done);
      std::vector<std::int16_t*> slices;
      for (std::int64_t i = 0; i < batch; ++i) slices.push_back(hu.data() + (done + i) * voxels);
      stack_->decode(next_, slices);
      if (transposed_ || flip_x_ || flip_y_)
        parallel_for(batch, [&](std::int64_t i) { reorient(slices[static_cast<std::size_t>(i)]); });
      next_ += batch;
      done += batch;
      progress.advance(batch);
    }
    return count;
  }

 private:
  void reorient(std::int16_t* slice) const {
    const std::int64_t width = geometry_.size.x, height = geometry_.size.y;
    if (transposed_) {
      const std::vector<std::int16_t> stored(slice, slice + width * height);
      for (std::int64_t y = 0; y < height; ++y)
        for (std::int64_t x = 0; x < width; ++x)
          slice[y * width + x] = stored[static_cast<std::size_t>(x * height + y)];
    }
    if (flip_x_)
      for (std::int64_t y = 0; y < height; ++y) std::reverse(slice + y * width, slice + (y + 1) * width);
    if (flip_y_)
      for (std::int64_t y = 0; y < height / 2; ++y)
        std::swap_ranges(slice + y * width, slice + (y + 1) * width, slice + (height - 1 - y) * width);
  }

  std::unique_ptr<SliceStack> stack_;
  VolumeGeometry geometry_;
  bool transposed_, flip_x_, flip_y_;
  std::int64_t next_ = 0;
};

/// Why a stack must be resampled, in words.
std::string reasons(const SliceStack& stack, const Layout& layout, const ScanInfo& info) {
  std::string text;
  const auto add = [&](const std::string& reason) { text += (text.empty() ? "" : ", ") + reason; };
  if (info.tilt_deg > 0) add(fmt::format("a gantry tilt of {:.1f} deg", info.tilt_deg));
  if (!info.gaps.empty()) add("uneven slice spacing");
  const auto [smallest, largest] = std::ranges::minmax(
      stack.planes, {}, [](const SlicePlane& plane) { return glm::length(plane.i_step_mm); });
  if (glm::length(largest.i_step_mm) > (1 + kUneven) * glm::length(smallest.i_step_mm))
    add(fmt::format("pixel sizes from {:.3f} to {:.3f} mm", glm::length(smallest.i_step_mm),
                    glm::length(largest.i_step_mm)));
  const double rotation_deg = glm::degrees(std::acos(std::min(1.0, std::abs(layout.normal[layout.axes[2]]))));
  const glm::dvec3 i = glm::normalize(stack.planes.front().i_step_mm);
  const double turn_deg = glm::degrees(std::acos(std::min(1.0, std::abs(i[layout.axes[0]]))));
  // A tilted gantry alone explains slices that lean, but not rows that do.
  const double oblique_deg = info.tilt_deg > 0 ? turn_deg : std::max(rotation_deg, turn_deg);
  if (oblique_deg > 0.01)
    add(fmt::format("slices rotated by {:.2f} deg from the patient's axes", oblique_deg));
  if (text.empty()) add("slices shifted within their plane");
  return text;
}

}  // namespace

void SliceStack::decode(std::int64_t first, std::span<std::int16_t* const> slices) {
  prepare();
  std::vector<SliceSource::HuRange> ranges(slices.size());
  parallel_for(std::ssize(slices), [&](std::int64_t s) {
    const auto index = static_cast<std::size_t>(s);
    ranges[index] = decode_slice(first + s, {slices[index], static_cast<std::size_t>(columns * rows)});
  });
  if (!range_) range_ = kNoHu;
  for (const SliceSource::HuRange& one : ranges) include(*range_, one);
  for (std::size_t s = 0; s < slices.size(); ++s) sample(first + static_cast<std::int64_t>(s), slices[s]);
  decoded_ += std::ssize(slices);
  if (decoded_ == std::ssize(planes)) check_values();
}

void SliceStack::sample(std::int64_t slice, const std::int16_t* hu) {
  constexpr std::int64_t kSlices = 16, kStride = 7;
  if (slice % std::max<std::int64_t>(1, std::ssize(planes) / kSlices) != 0) return;
  for (std::int64_t i = 0; i < columns * rows; i += kStride) histogram_.add(hu[i]);
}

void SliceStack::check_values() const {
  constexpr double kMostClamped = 0.05;
  constexpr std::int64_t kFew = 1000;
  const double share = static_cast<double>(range_->clamped) /
                       (static_cast<double>(columns * rows) * static_cast<double>(planes.size()));
  if (range_->lowest > range_->highest)
    throw InputError("{}: none of its voxels is a number; export the scan again", name);
  if (range_->clamped > kFew && share > kMostClamped)
    throw InputError(
        "{}: {:.0f} % of its voxels are above {} HU, up to {:g}; export the scan in Hounsfield units", name,
        100 * share, kMaxHu, range_->highest);
}

SliceSource::HuRange SliceStack::hu_range() const {
  if (!range_) return {};
  SliceSource::HuRange range = *range_;
  range.is_shifted = histogram_.is_shifted();
  return range;
}

glm::dvec3 upward(const glm::dvec3& direction) {
  return direction[main_axis(direction)] < 0 ? -direction : direction;
}

char side(const glm::dvec3& direction) {
  const int axis = main_axis(direction);
  return "RLAPIS"[2 * axis + (direction[axis] > 0 ? 1 : 0)];
}

Scan deliver(std::unique_ptr<SliceStack> stack, ScanInfo info, const ScanOptions& options) {
  const Layout layout = layout_of(*stack);
  const auto slices = static_cast<std::int64_t>(stack->planes.size());
  info.size = {stack->columns, stack->rows, slices};
  info.spacing_mm = {layout.i_mm, layout.j_mm, layout.k_mm};
  for (std::size_t k = 0; k < layout.gaps_mm.size(); ++k)
    if (!is_even(layout.gaps_mm[k], layout.k_mm))
      info.gaps.push_back({static_cast<std::int64_t>(k), layout.gaps_mm[k]});
  // A tilt that moves no voxel off the grid is rounding in the positions.
  const double drift_mm = std::tan(layout.tilt_rad) * layout.k_mm * static_cast<double>(slices - 1);
  if (drift_mm > kOffGrid * std::min(layout.i_mm, layout.j_mm)) info.tilt_deg = glm::degrees(layout.tilt_rad);

  if (!info.gaps.empty()) {
    const auto [smallest, largest] = std::ranges::minmax(layout.gaps_mm);
    const std::string uneven =
        fmt::format("{} of {} slice distances differ{} from the median of {:.2f} mm ({:.2f} to {:.2f} mm)",
                    info.gaps.size(), layout.gaps_mm.size(), info.gaps.size() == 1 ? "s" : "", layout.k_mm,
                    smallest, largest);
    if (options.keep_slices)
      throw InputError("{}: {}; keep_slices forbids resampling them to a uniform grid", stack->name, uneven);
    info.warnings.push_back(uneven);
  }

  const VolumeGeometry grid = covering_grid(*stack, layout);
  validate(grid, stack->name);
  require_bodily(grid, stack->name);
  const bool exact = info.gaps.empty() && lies_on(grid, *stack, layout);
  info.keeps_grid = exact && info.orientation == "LPS";
  if (options.offset_hu != 0)
    info.notes.push_back(fmt::format("{:+g} HU were added to all values", options.offset_hu));
  if (!exact)
    info.notes.push_back(
        fmt::format("resampled to {} x {} x {} voxels of {:.3f} x {:.3f} x {:.3f} mm because of {}",
                    grid.size.x, grid.size.y, grid.size.z, grid.spacing_mm.x, grid.spacing_mm.y,
                    grid.spacing_mm.z, reasons(*stack, layout, info)));
  else if (info.orientation != "LPS")
    info.notes.push_back(fmt::format("reoriented from {} to LPS", info.orientation));

  // Coronal and sagittal slices go through the resampler too, which meets their voxels exactly.
  if (exact && layout.axes[2] == 2)
    return {std::move(info), std::make_unique<AlignedSource>(std::move(stack), grid)};
  return {std::move(info), resample(std::move(stack), grid)};
}

}  // namespace xraycast
