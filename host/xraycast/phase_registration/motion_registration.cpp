#include "xraycast/phase_registration/motion_registration.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/motion/displacement.hpp"
#include "xraycast/motion/motion_writer.hpp"
#include "xraycast/phase_registration/elastix.hpp"
#include "xraycast/phase_registration/landmark_pairs.hpp"
#include "xraycast/scan/scan.hpp"
#include "xraycast/volume/block_means.hpp"
#include "xraycast/volume/trilinear_hu.hpp"

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace xraycast {
namespace {

// ---- scans -----------------------------------------------------------------------------------------------

/// Voxels averaged to about this size, which is far below what a B-spline follows.
constexpr double kVoxel_mm = 1.5;

Volume averaged(const Volume& scan) {
  const VolumeGeometry& fine = scan.geometry();
  Index3 by(1);
  for (int axis = 0; axis < 3; ++axis)
    by[axis] = std::clamp<std::int64_t>(std::llround(kVoxel_mm / fine.spacing_mm[axis]), 1, fine.size[axis]);
  return block_means(scan, by);
}

/// 1 where a scan is above 0, else 0: elastix reads bytes.
Volume mask_of(const std::filesystem::path& path, Progress& progress) {
  const RegisteredScan scan = phase_of_file(path).open(progress);
  Volume mask(scan.volume->geometry());
  std::ranges::transform(scan.volume->hu(), mask.hu().begin(),
                         [](std::int16_t hu) { return static_cast<std::int16_t>(hu > 0 ? 1 : 0); });
  if (std::ranges::none_of(mask.hu(), [](std::int16_t hu) { return hu > 0; }))
    throw InputError("`mask` {}: is nowhere above 0; give one that is, where the phases are to match",
                     path.string());
  return mask;
}

/// Throws InputError for a phase whose places are not those of the reference.
void check_frame(const RegisteredScan& reference, const std::string& reference_name,
                 const RegisteredScan& phase, const std::string& name) {
  const std::string& a = reference.frame_of_reference_uid;
  const std::string& b = phase.frame_of_reference_uid;
  if (!a.empty() && !b.empty() && a != b)
    throw InputError(
        "{}: is in another frame of reference than {}, so that their places cannot be compared; give the "
        "phases of one scan",
        name, reference_name);
  const VolumeGeometry &r = reference.volume->geometry(), &p = phase.volume->geometry();
  const glm::dvec3 shared_mm =
      glm::max(glm::min(r.upper_mm(), p.upper_mm()) - glm::max(r.lower_mm(), p.lower_mm()), glm::dvec3(0));
  const glm::dvec3 least_mm = glm::min(r.upper_mm() - r.lower_mm(), p.upper_mm() - p.lower_mm());
  constexpr double kLeast = 0.5;
  if (glm::any(glm::lessThan(shared_mm, kLeast * least_mm)))
    throw InputError(
        "{}: overlaps {} by {:.0f} x {:.0f} x {:.0f} mm only; give phases of the same part of the body", name,
        reference_name, shared_mm.x, shared_mm.y, shared_mm.z);
}

bool is_same(const Volume& a, const Volume& b) {
  return a.geometry() == b.geometry() && std::ranges::equal(a.hu(), b.hu());
}

// ---- fields ----------------------------------------------------------------------------------------------

/// A displacement at the nodes of a grid around the reference; beyond `known`, where it was found, that of
/// its nearest place.
VectorImage field_around(const VolumeGeometry& reference, const VolumeGeometry& known,
                         const Displacement& moves, double spacing_mm) {
  const glm::dvec3 lower_mm = reference.lower_mm();
  const Index3 steps(glm::ceil((reference.upper_mm() - lower_mm) / spacing_mm));
  FieldGrid grid{glm::max(steps, Index3(1)) + Index3(1), lower_mm, glm::dmat3(spacing_mm)};
  VectorImage field{grid, std::vector<glm::vec3>(static_cast<std::size_t>(grid.nodes()))};
  const glm::dvec3 first_mm = known.origin_mm,
                   last_mm = known.to_world_mm(glm::dvec3(known.size - Index3(1)));
  parallel_for(grid.size.z, [&](std::int64_t k) {
    auto out = field.vectors.begin() + k * grid.size.x * grid.size.y;
    for (std::int64_t j = 0; j < grid.size.y; ++j)
      for (std::int64_t i = 0; i < grid.size.x; ++i)
        *out++ = glm::vec3(moves.at(glm::clamp(grid.to_world_mm({i, j, k}), first_mm, last_mm)));
  });
  return field;
}

// ---- what was gained -------------------------------------------------------------------------------------

/// A phase's voxels, the reference at the same places, and the reference as the phase shows it.
class Comparison {
 public:
  Comparison(const Volume& phase, const Volume& reference, const Displacement* moves)
      : grid_(phase.geometry()),
        before_(static_cast<std::size_t>(grid_.voxel_count())),
        after_(before_.size()),
        is_body_(before_.size()) {
    const TrilinearHu hu(reference);
    lengths_mm_.resize(static_cast<std::size_t>(grid_.size.z));
    parallel_for(grid_.size.z, [&](std::int64_t z) {
      auto voxel = static_cast<std::size_t>(z * grid_.slice_voxels());
      double& longest_mm = lengths_mm_[static_cast<std::size_t>(z)];
      for (std::int64_t y = 0; y < grid_.size.y; ++y)
        for (std::int64_t x = 0; x < grid_.size.x; ++x, ++voxel) {
          constexpr int kLung_hu = -950;  // below is the air around
          const glm::dvec3 x_mm = grid_.to_world_mm({x, y, z}),
                           d_mm = moves ? moves->at(x_mm) : glm::dvec3(0);
          const int here = phase.at(x, y, z), there = hu.at(x_mm), found = hu.at(x_mm + d_mm);
          before_[voxel] = static_cast<std::int16_t>(std::clamp(here - there, -kMost_hu, kMost_hu));
          after_[voxel] = static_cast<std::int16_t>(std::clamp(here - found, -kMost_hu, kMost_hu));
          is_body_[voxel] = here > kLung_hu || there > kLung_hu ? 1 : 0;
          if (is_body_[voxel]) longest_mm = std::max(longest_mm, glm::length(d_mm));
        }
    });
  }

  double longest_mm() const { return std::ranges::max(lengths_mm_); }
  double before_hu() const { return rms(before_); }
  double after_hu() const { return rms(after_); }

  /// Across an axis, 0 for sagittal and 1 for coronal, with half of the difference before it on either side.
  DifferenceSlice slice(int axis) const {
    std::vector<double> sums(static_cast<std::size_t>(grid_.size[axis]));
    std::size_t voxel = 0;
    for (Index3 v(0); v.z < grid_.size.z; ++v.z)
      for (v.y = 0; v.y < grid_.size.y; ++v.y)
        for (v.x = 0; v.x < grid_.size.x; ++v.x, ++voxel)
          sums[static_cast<std::size_t>(v[axis])] += std::abs(before_[voxel]) * is_body_[voxel];
    const double all = std::accumulate(sums.begin(), sums.end(), 0.0);
    std::int64_t at = 0;
    for (double before = sums[0]; before < 0.5 * all; before += sums[static_cast<std::size_t>(at)]) ++at;
    const int across = axis == 0 ? 1 : 0;
    DifferenceSlice slice{grid_.size[across], grid_.size.z, {grid_.spacing_mm[across], grid_.spacing_mm.z}};
    for (std::int64_t z = grid_.size.z - 1; z >= 0; --z)
      for (std::int64_t column = 0; column < slice.width; ++column) {
        const std::int64_t x = axis == 0 ? at : column, y = axis == 0 ? column : at;
        const auto source = static_cast<std::size_t>((z * grid_.size.y + y) * grid_.size.x + x);
        slice.before_hu.push_back(before_[source]);
        slice.after_hu.push_back(after_[source]);
      }
    return slice;
  }

 private:
  static constexpr int kMost_hu = 30000;

  double rms(const std::vector<std::int16_t>& difference) const {
    double sum = 0;
    std::int64_t voxels = 0;
    for (std::size_t i = 0; i < difference.size(); ++i) {
      if (!is_body_[i]) continue;
      sum += static_cast<double>(difference[i]) * difference[i];
      ++voxels;
    }
    return std::sqrt(sum / static_cast<double>(std::max<std::int64_t>(1, voxels)));
  }

  VolumeGeometry grid_;
  std::vector<std::int16_t> before_, after_;
  std::vector<std::uint8_t> is_body_;
  std::vector<double> lengths_mm_;  ///< the longest of each slice
};

PhaseRegistration::Landmarks landmarks_of(const std::vector<LandmarkPair>& pairs, const Displacement* moves) {
  PhaseRegistration::Landmarks found{pairs.size()};
  for (const LandmarkPair& pair : pairs) {
    const glm::dvec3 d_mm = moves ? moves->at(pair.phase_mm) : glm::dvec3(0);
    found.before_mm += glm::distance(pair.phase_mm, pair.reference_mm) / static_cast<double>(pairs.size());
    found.after_mm +=
        glm::distance(pair.phase_mm + d_mm, pair.reference_mm) / static_cast<double>(pairs.size());
  }
  return found;
}

std::vector<double> phases_of(const MotionRegistrationRequest& request, std::size_t count) {
  std::vector<double> phases = request.at;
  for (std::size_t i = phases.size(); i < count; ++i)
    phases.push_back(static_cast<double>(i + 1) / static_cast<double>(count + 1));
  return phases;
}

}  // namespace

PhaseOfScan phase_of_file(const std::filesystem::path& path, const ScanOptions& options) {
  return {path.string(), [path, options](Progress& progress) {
            const Scan scan = open_scan(path, options, progress);
            return RegisteredScan{
                std::make_shared<const Volume>(collect(*scan.source, progress, path.string())),
                frame_of_reference_uid(scan.info)};
          }};
}

void check(const MotionRegistrationRequest& request, std::size_t phases) {
  if (phases == 0) throw InputError("`phases`: there are none; give the scans of the other phases too");
  if (!request.at.empty() && request.at.size() != phases)
    throw InputError("`at` holds {} for {}; give one for each, without the reference",
                     pluralize(request.at.size(), "phase"), pluralize(phases, "scan"));
  double before = 0;
  for (const double phase : request.at) {
    if (!(phase > before && phase <= 1))
      throw InputError("`at` {}: phases must ascend, above 0, where the reference is, and up to 1", phase);
    before = phase;
  }
  if (!(request.period_s >= 0.001 && request.period_s <= 1e6))
    throw InputError("`period_s` {}: must be 0.001 to 1000000 s", request.period_s);
  if (!(request.grid_mm >= 4 && request.grid_mm <= 200))
    throw InputError("`grid_mm` {}: must be 4 to 200 mm", request.grid_mm);
  if (!(request.spacing_mm >= 1 && request.spacing_mm <= 20))
    throw InputError("`spacing_mm` {}: must be 1 to 20 mm", request.spacing_mm);
  if (request.mode.empty() || request.mode.find_first_of("=, \t\n/") != std::string::npos)
    throw InputError("`mode` {}: must be a word without =, / and commas", excerpt(request.mode));
}

RegisteredMotion register_phases(const RegisteredScan& reference, const std::string& name,
                                 const std::vector<PhaseOfScan>& phases,
                                 const MotionRegistrationRequest& request, Progress& progress) {
  check(request, phases.size());
  const CancelScope scope(progress);
  std::vector<std::vector<LandmarkPair>> landmarks(phases.size());
  if (!request.landmarks.empty()) landmarks = read_landmark_pairs(request.landmarks, phases.size());
  require_elastix(progress);
  std::optional<Volume> mask;
  if (!request.mask.empty()) mask = mask_of(request.mask, progress);
  const Volume coarse_reference = averaged(*reference.volume);
  const std::vector<double> at = phases_of(request, phases.size());
  RegisteredMotion motion{request.mode, request.period_s};
  for (std::size_t i = 0; i < phases.size(); ++i) {
    const Stopwatch stopwatch;
    const RegisteredScan scan = phases[i].open(progress);
    check_frame(reference, name, scan, phases[i].name);
    PhaseRegistration& found = motion.phases.emplace_back();
    found.name = phases[i].name;
    found.phase = at[i];
    const Volume coarse = averaged(*scan.volume);
    std::shared_ptr<const Displacement> moves;
    if (!is_same(*scan.volume, *reference.volume)) {
      const auto spline = register_by_elastix(
          {coarse, coarse_reference, mask ? &*mask : nullptr, request.grid_mm,
           fmt::format("registering phase {} of {}", i + 1, phases.size()), phases[i].name},
          progress);
      found.field =
          field_around(reference.volume->geometry(), coarse.geometry(), *spline, request.spacing_mm);
      moves = field_of(*found.field, phases[i].name);
      if (const auto folds = moves->folds(); folds.nodes > 0)
        motion.warnings.push_back(
            fmt::format("{}: the field folds at {} of {}; a larger `grid_mm` is smoother", phases[i].name,
                        folds.nodes, pluralize(folds.of, "node")));
    }
    const Comparison comparison(coarse, coarse_reference, moves.get());
    found.longest_mm = comparison.longest_mm();
    found.before_hu = comparison.before_hu();
    found.after_hu = comparison.after_hu();
    found.sagittal = comparison.slice(0);
    found.coronal = comparison.slice(1);
    if (!landmarks[i].empty()) found.landmarks = landmarks_of(landmarks[i], moves.get());
    found.seconds = stopwatch.ms() / 1000;
  }
  return motion;
}

void write_motion(const RegisteredMotion& motion, const std::filesystem::path& folder, Progress& progress) {
  FieldMode mode{motion.mode, motion.period_s, {}, {{0, nullptr}}};
  for (const PhaseRegistration& phase : motion.phases)
    mode.keys.emplace_back(phase.phase, phase.field ? &*phase.field : nullptr);
  write_motion(mode, folder, progress);
}

}  // namespace xraycast
