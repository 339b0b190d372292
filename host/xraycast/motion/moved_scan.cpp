#include "xraycast/motion/moved_scan.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/volume/trilinear_hu.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>
#include <thread>
#include <utility>

namespace xraycast {
namespace {

constexpr int kBody_hu = -300;  // as OutlineFinder has it

// ---- the body against its displacement -----------------------------------------------------------------

/// Voxels of a scan on a grid of about 6 mm, and what is known of the displacement there.
class Samples {
 public:
  Samples(const Volume& scan, const HeldMotion& motion) : volume_(scan.geometry()) {
    constexpr double kStep_mm = 6;
    for (int axis = 0; axis < 3; ++axis) {
      stride_[axis] = std::max<std::int64_t>(1, std::llround(kStep_mm / volume_.spacing_mm[axis]));
      size_[axis] = (volume_.size[axis] + stride_[axis] - 1) / stride_[axis];
    }
    samples_.resize(static_cast<std::size_t>(size_.x * size_.y * size_.z));
    parallel_for(size_.y * size_.z, [&](std::int64_t row) {
      for (std::int64_t i = 0; i < size_.x; ++i) visit({i, row % size_.y, row / size_.y}, scan, motion);
    });
  }

  struct Count {
    std::int64_t body = 0, covered = 0, beyond_scan = 0;
    double torn_mm = 0;  ///< the longest displacement beside a place that is not covered
    glm::dvec3 torn_at_mm{0};
  };
  Count count() const;

 private:
  struct Sample {
    bool is_body = false, is_covered = false, is_beyond_scan = false;
    float length_mm = 0;  ///< of the displacement
  };

  Sample& at(const Index3& place) {
    return samples_[static_cast<std::size_t>((place.z * size_.y + place.y) * size_.x + place.x)];
  }
  const Sample& at(const Index3& place) const { return const_cast<Samples*>(this)->at(place); }

  void visit(const Index3& place, const Volume& scan, const HeldMotion& motion);
  bool has_uncovered_neighbour(const Index3& place) const;

  VolumeGeometry volume_;
  Index3 stride_{1, 1, 1}, size_{0, 0, 0};
  std::vector<Sample> samples_;
};

void Samples::visit(const Index3& place, const Volume& scan, const HeldMotion& motion) {
  const Index3 voxel = place * stride_;
  if (scan.at(voxel.x, voxel.y, voxel.z) <= kBody_hu) return;
  const glm::dvec3 x_mm = volume_.to_world_mm(voxel), d_mm = motion.displacement_mm(x_mm);
  const glm::dvec3 source_mm = x_mm + d_mm;
  at(place) = {true, motion.covers(x_mm),
               // Written so that NaN is beyond.
               !(glm::all(glm::greaterThanEqual(source_mm, volume_.lower_mm())) &&
                 glm::all(glm::lessThanEqual(source_mm, volume_.upper_mm()))),
               static_cast<float>(glm::length(d_mm))};
}

bool Samples::has_uncovered_neighbour(const Index3& place) const {
  for (int axis = 0; axis < 3; ++axis)
    for (const std::int64_t side : {-1, 1}) {
      Index3 next = place;
      next[axis] += side;
      if (next[axis] < 0 || next[axis] >= size_[axis]) continue;
      if (at(next).is_body && !at(next).is_covered) return true;
    }
  return false;
}

Samples::Count Samples::count() const {
  Count count;
  for (Index3 place(0); place.z < size_.z; ++place.z)
    for (place.y = 0; place.y < size_.y; ++place.y)
      for (place.x = 0; place.x < size_.x; ++place.x) {
        const Sample& sample = at(place);
        if (!sample.is_body) continue;
        ++count.body;
        count.beyond_scan += sample.is_beyond_scan ? 1 : 0;
        if (!sample.is_covered) continue;
        ++count.covered;
        if (sample.length_mm > count.torn_mm && has_uncovered_neighbour(place)) {
          count.torn_mm = sample.length_mm;
          count.torn_at_mm = volume_.to_world_mm(place * stride_);
        }
      }
  return count;
}

/// Throws InputError for a displacement that lies elsewhere than the body or ends in it while it moves.
void require_coverage(const Samples::Count& count, const VolumeGeometry& scan,
                      const std::string& motion_name) {
  if (count.body == 0) return;
  const glm::dvec3 lower_mm = scan.lower_mm(), upper_mm = scan.upper_mm();
  if (count.covered == 0)
    throw InputError(
        "{}: its displacements lie elsewhere than the body, which is within {:.0f} to {:.0f}, {:.0f} to "
        "{:.0f} and {:.0f} to {:.0f} mm (LPS); give fields in the scan's own frame",
        motion_name, lower_mm.x, upper_mm.x, lower_mm.y, upper_mm.y, lower_mm.z, upper_mm.z);
  constexpr double kTear_mm = 1;  // less shows as little as a voxel
  if (count.torn_mm <= kTear_mm) return;
  const glm::dvec3& at = count.torn_at_mm;
  throw InputError(
      "{}: its displacements end within the body, at {:.0f}, {:.0f}, {:.0f} mm, where they still are {:.1f} "
      "mm long; give fields that cover the scan or come to rest at their border",
      motion_name, at.x, at.y, at.z, count.torn_mm);
}

// ---- slices --------------------------------------------------------------------------------------------

class MovedSource final : public SliceSource {
 public:
  MovedSource(std::shared_ptr<const Volume> scan, HeldMotion motion, const HuRange& hu_range)
      : scan_(std::move(scan)),
        motion_(std::move(motion)),
        hu_range_(hu_range),
        volume_(scan_->geometry()),
        hu_(*scan_) {}

  const VolumeGeometry& geometry() const override { return volume_; }
  HuRange hu_range() const override { return hu_range_; }

  std::int64_t read(std::span<std::int16_t> hu, Progress& progress) override {
    const auto cores = std::max<std::int64_t>(1, std::thread::hardware_concurrency());
    const std::int64_t voxels = volume_.slice_voxels();
    const std::int64_t count =
        std::min(static_cast<std::int64_t>(hu.size()) / voxels, volume_.size.z - next_);
    for (std::int64_t done = 0; done < count;) {
      const std::int64_t batch = std::min(4 * cores, count - done);
      parallel_for(batch * volume_.size.y, [&](std::int64_t row) {
        fill_row(row % volume_.size.y, next_ + row / volume_.size.y,
                 hu.data() + done * voxels + row * volume_.size.x);
      });
      next_ += batch;
      done += batch;
      progress.advance(batch);
    }
    return count;
  }

 private:
  void fill_row(std::int64_t y, std::int64_t z, std::int16_t* out) const {
    std::vector<glm::dvec3> places_mm(static_cast<std::size_t>(volume_.size.x));
    for (std::size_t x = 0; x < places_mm.size(); ++x) places_mm[x] = volume_.to_world_mm({x, y, z});
    motion_.displace(places_mm);
    for (std::size_t x = 0; x < places_mm.size(); ++x) out[x] = hu_.at(places_mm[x]);
  }

  std::shared_ptr<const Volume> scan_;
  HeldMotion motion_;
  HuRange hu_range_;
  VolumeGeometry volume_;
  TrilinearHu hu_;
  std::int64_t next_ = 0;
};

}  // namespace

std::vector<std::string> check_motion(const Volume& scan, const HeldMotion& motion,
                                      const std::string& motion_name) {
  // Each displacement for itself: one that covers the heart alone goes with one of the whole body.
  for (const std::vector<HeldMotion::Part>& mode : motion.modes())
    for (const HeldMotion::Part& part : mode)
      require_coverage(Samples(scan, HeldMotion({{part}})).count(), scan.geometry(), motion_name);
  const Samples::Count count = Samples(scan, motion).count();
  constexpr double kMuch = 0.01;
  const double share =
      static_cast<double>(count.beyond_scan) / static_cast<double>(std::max<std::int64_t>(1, count.body));
  if (share <= kMuch) return {};
  return {
      fmt::format("{:.2g} % of the body show what lies beyond the scan, which is air; if that is not meant, "
                  "check the sign of {}: the place x shows what lies at x + d(x) in the scan, in mm, LPS",
                  100 * share, motion_name)};
}

std::unique_ptr<SliceSource> moved_slices(std::shared_ptr<const Volume> scan, HeldMotion motion,
                                          SliceSource::HuRange hu_range) {
  return std::make_unique<MovedSource>(std::move(scan), std::move(motion), hu_range);
}

Scan moved(Scan scan, const HeldMotion& motion, const std::string& motion_name, Progress& progress) {
  if (motion.is_still()) return scan;
  const auto volume = std::make_shared<const Volume>(collect(*scan.source, progress));
  const SliceSource::HuRange hu_range = scan.source->hu_range();
  for (std::string& warning : check_motion(*volume, motion, motion_name))
    scan.info.warnings.push_back(std::move(warning));
  scan.source = moved_slices(volume, motion, hu_range);
  return scan;
}

}  // namespace xraycast
