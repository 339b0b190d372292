#include "xraycast/segmentation/segment.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/mask/morphology.hpp"
#include "xraycast/segmentation/body_mask.hpp"
#include "xraycast/segmentation/bone.hpp"
#include "xraycast/segmentation/candidates.hpp"
#include "xraycast/segmentation/denoise.hpp"
#include "xraycast/segmentation/gap_closing.hpp"
#include "xraycast/segmentation/lumen_completion.hpp"
#include "xraycast/segmentation/ridge_detection.hpp"
#include "xraycast/segmentation/ridge_tracking.hpp"
#include "xraycast/segmentation/seeds.hpp"
#include "xraycast/segmentation/trabecular_bone.hpp"
#include "xraycast/segmentation/vessel_selection.hpp"

#include <glm/common.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

constexpr std::int64_t kMinSlices = 10;

void subtract(Mask& mask, const Mask& other) {
  parallel_for(mask.geometry.size.z, [&](std::int64_t z) {
    const auto slice = static_cast<std::size_t>(mask.geometry.slice_voxels()),
               first = static_cast<std::size_t>(z) * slice;
    for (std::size_t i = first; i < first + slice; ++i)
      mask.voxels[i] &= static_cast<std::uint8_t>(other.voxels[i] ^ 1);
  });
}

Mask united(Mask a, const Mask& b) {
  for (std::size_t i = 0; i < a.voxels.size(); ++i) a.voxels[i] |= b.voxels[i];
  return a;
}

void intersect(Mask& mask, const Mask& other) {
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) mask.voxels[i] &= other.voxels[i];
}

/// Removes components that are nowhere thicker than two voxels: partial volume of bone, and noise.
void remove_thin_components(Mask& mask) {
  const Components components(mask);
  std::vector<bool> keep(static_cast<std::size_t>(components.count()));
  for (const Components::Run& run : components.runs())
    for (std::int64_t i = run.first; i < run.first + run.length; ++i) {
      if (keep[static_cast<std::size_t>(run.component)]) break;
      const Index3 voxel = voxel_at(mask.geometry, i);
      if (std::all_of(kNeighbours.begin(), kNeighbours.begin() + 18,
                      [&](const Index3& step) { return mask.at(voxel + step); }))
        keep[static_cast<std::size_t>(run.component)] = true;
    }
  mask = components.select(keep);
}

void check(const Volume& volume, const SegmentOptions& options, const std::string& name) {
  const VolumeGeometry& g = volume.geometry();
  if (g.size.z < kMinSlices)
    throw InputError("{}: {}, too few to follow vessels; at least {} are needed", name,
                     pluralize(g.size.z, "slice"), kMinSlices);
  for (const auto* points : {&options.markers.vessels_mm, &options.markers.not_vessels_mm})
    for (const glm::dvec3& p : *points) {
      const glm::dvec3 lower = g.lower_mm(), upper = g.upper_mm();
      for (int axis = 0; axis < 3; ++axis)
        if (p[axis] < lower[axis] || p[axis] > upper[axis])
          throw InputError(
              "{}: the point ({:.1f}, {:.1f}, {:.1f}) mm lies outside the scan, which extends from ({:.1f}, "
              "{:.1f}, {:.1f}) to ({:.1f}, {:.1f}, {:.1f}) mm",
              name, p.x, p.y, p.z, lower.x, lower.y, lower.z, upper.x, upper.y, upper.z);
    }
}

/// The window of CT numbers, and whether it is that of the seeds.
struct ChosenWindow {
  HuWindow hu;
  bool is_of_seeds;
};

[[noreturn]] void throw_without_contrast(const Volume& volume, const std::string& name,
                                         ComputeDevice& device) {
  std::string places;
  for (const Candidate& c : brightest_candidates(volume, device))
    places += fmt::format("{}({:.0f}, {:.0f}, {:.0f}) mm with {:.0f} HU", places.empty() ? "" : ", ",
                          c.point_mm.x, c.point_mm.y, c.point_mm.z, c.hu);
  throw NoContrast(
      "{}: no vessel: no vessels filled with contrast agent stand out; give a seed, a point in a vessel{}{}",
      name, places.empty() ? "" : "; the brightest candidates are ", places);
}

/// `scan` is denoised, `volume` is not.
ChosenWindow choose_window(const Volume& scan, const Volume& volume, const std::vector<Seed>& seeds,
                           const SegmentOptions& options, const std::string& name, ComputeDevice& device,
                           Progress& progress) {
  if (options.window_hu) {
    const auto [low, high] = *options.window_hu;
    if (low >= high)
      throw InputError("{}: the window's lower limit, {} HU, is not below its upper one, {} HU", name, low,
                       high);
    return {{low, low, high}, false};
  }
  const std::optional<Contrast> contrast = find_contrast(scan, name, progress);
  if (!contrast && seeds.empty()) throw_without_contrast(volume, name, device);
  if (!contrast) return {window_of_seeds(seeds, name), true};
  const HuWindow window = window_of(*contrast);
  if (seeds.empty()) return {window, false};
  const Mask bright = threshold(scan, window);
  if (std::ranges::any_of(seeds, [&](const Seed& s) { return needs_own_window(s, window, bright); }))
    return {window_of_seeds(seeds, name), true};
  return {window, false};
}

/// Whether there is air around the body; a scan without it was subtracted, so that only vessels are bright.
bool has_air(const Volume& volume) {
  return std::ranges::any_of(volume.hu(), [](std::int16_t hu) { return hu < -500; });
}

/// In noise so heavy that neither bone nor chambers can be recognised, vessels are found as ridges.
Mask segment_in_noise(const Volume& volume, const Markers& markers, const std::string& name,
                      ComputeDevice& device, Progress& progress, const SegmentLog& log) {
  constexpr double kTracking_vox = 0.7, kLumen_vox = 0.8;
  progress.begin("detecting ridges", 2, "scans");
  Mask ridges = detect_ridges(ridge_strength(volume, device), volume.geometry());
  progress.advance();
  ridges = united(track_ridges(contrast_to_noise(volume, kTracking_vox, device), ridges, progress), ridges);
  progress.advance();
  Mask vessels = recover_lumen(ridges, contrast_to_noise(volume, kLumen_vox, device));
  if (vessels.count() == 0)
    throw InputError(
        "{}: no vessel: no thin bright structure stands out from the noise; give a scan with less noise",
        name);
  log.on_step("ridges", ridges);
  log.on_step("lumen", vessels);
  if (markers.vessels_mm.empty() && markers.not_vessels_mm.empty()) {
    vessels = without_small_components(vessels);
  } else {
    separate_chambers(vessels, markers, name, progress);
    log.on_step("chambers", vessels);
    vessels = select_vessels(vessels, markers, name, progress);
  }
  log.on_step("selection", vessels);
  return vessels;
}

}  // namespace

namespace {

/// Those points to exclude that lie in what is left; what the others lie in is gone.
Markers live(const Markers& markers, const Mask& bright, const Mask& left, const std::string& name) {
  Markers result = markers;
  std::erase_if(result.not_vessels_mm, [&](const glm::dvec3& p) {
    nearest_voxel(bright, p, name);  // throws where nothing was bright
    return !is_near(left, p);
  });
  return result;
}

void remove_trabecular_bone(Mask& mask, const Mask& bone, Progress& progress) {
  const Mask trabecular = find_trabecular_bone(mask, bone, progress);
  subtract(mask, trabecular);
  remove_marrow(mask, united(bone, trabecular));
  progress.advance();
  remove_thin_components(mask);
  progress.advance();
}

/// The rim of a lumen, its dense wall and its holes.
void complete_lumen(const Volume& scan, const ChosenWindow& window, const Mask& bright, const Mask& bone,
                    Mask& vessels, Progress& progress) {
  if (window.is_of_seeds)
    add_half_filled_rim(scan, between(scan, window.hu.high_hu, kMaxHu), vessels);
  else
    add_partial_volume_rim(bright, vessels);
  progress.advance();
  if (!window.is_of_seeds) add_dense_wall(scan, window.hu, bone, vessels);
  progress.advance();
  constexpr double kStrut_mm2 = 30;
  fill_holes(vessels, kStrut_mm2);
  progress.advance();
}

/// Whether what was bright is bone alone: with contrast agent, 9 % (a head) to 60 % (a trunk) is not
/// recognised as trabecular bone; in scans without it 5 % and less.
bool is_bone_alone(std::int64_t before_trabecular, std::int64_t after) {
  return 15 * after < before_trabecular;
}

/// Everything within the window, in the body.
Mask bright_voxels(const Volume& scan, const ChosenWindow& window, const Mask& body,
                   const std::string& name) {
  Mask mask = window.is_of_seeds ? between(scan, window.hu.low_hu, window.hu.high_hu)
              : has_air(scan)    ? threshold(scan, window.hu)
                                 : threshold_with_hysteresis(scan, window.hu);
  if (2 * mask.count() > scan.geometry().voxel_count())
    throw InputError(
        "{}: no vessel: more than half of the scan lies above {:.0f} HU; give the window of the vessels' CT "
        "numbers",
        name, window.hu.low_hu);
  intersect(mask, body);
  return mask;
}

}  // namespace

Mask segment_mask(const Volume& volume, const SegmentOptions& options, const std::string& name,
                  ComputeDevice& device, Progress& progress, SegmentLog* log) {
  check(volume, options, name);
  SegmentLog unheard;
  SegmentLog& heard = log != nullptr ? *log : unheard;
  const Markers& markers = options.markers;
  progress.begin("contrast", 5, "passes");
  heard.noise_hu = measure_noise_hu(volume);
  if (!options.window_hu && is_dominated_by_noise(volume))
    return segment_in_noise(volume, markers, name, device, progress, heard);
  progress.advance();
  std::optional<Volume> quiet = denoised(volume, device), smooth;
  progress.advance();
  const Volume& denoised_scan = quiet ? *quiet : volume;
  const bool is_subtracted = !has_air(denoised_scan);
  if (!markers.vessels_mm.empty()) smooth = smoothed_for_seeds(volume, device);
  const Volume& at_seeds = smooth ? *smooth : denoised_scan;
  const std::vector<Seed> seeds = is_subtracted ? std::vector<Seed>{} : look_at_seeds(at_seeds, markers);
  const ChosenWindow window = choose_window(denoised_scan, volume, seeds, options, name, device, progress);
  const Volume& scan = window.is_of_seeds ? at_seeds : denoised_scan;
  heard.window = window.hu;
  heard.is_window_of_seeds = window.is_of_seeds;

  progress.begin("thresholding", 1, "scans");
  Mask body(volume.geometry());
  std::ranges::fill(body.voxels, 1);
  Mask mask = bright_voxels(scan, window, body, name);
  check_seeds(seeds, mask, LostSeed::Cause::window, name);
  heard.on_step("window", mask);
  if (!is_subtracted) {
    body = find_body_mask(scan);
    intersect(mask, body);
    check_seeds(seeds, mask, LostSeed::Cause::body, name);
    heard.on_step("body", mask);
  }
  progress.advance();
  if (is_subtracted && markers.vessels_mm.empty() && markers.not_vessels_mm.empty()) {
    mask = without_small_components(mask);  // only vessels remain in a subtracted scan
    heard.on_step("selection", mask);
    return mask;
  }

  const Mask lumen = lumen_at_seeds(at_seeds, seeds, window.hu, body, markers, name);
  const auto give_lumen_back = [&] {
    if (!seeds.empty()) mask = united(std::move(mask), lumen);
  };
  give_lumen_back();
  body = Mask(VolumeGeometry{});  // a byte a voxel
  const Mask bright = mask;
  const Mask bone = is_subtracted ? Mask(mask.geometry) : find_bone(scan, window.hu, bright, progress);
  subtract(mask, bone);
  give_lumen_back();
  check_seeds(seeds, mask, LostSeed::Cause::bone, name);
  heard.on_step("bone", mask);
  separate_chambers(mask, live(markers, bright, mask, name), name, progress);
  give_lumen_back();
  check_seeds(seeds, mask, LostSeed::Cause::chamber, name);
  heard.on_step("chambers", mask);
  progress.begin("removing trabecular bone", 7, "passes");
  Mask candidates = mask;
  if (!is_subtracted) {
    constexpr double kBeside_mm = 3;
    intersect(candidates, dilated_by_cylinder(bone, kBeside_mm));
    progress.advance();
    const std::int64_t before = mask.count();
    remove_trabecular_bone(mask, bone, progress);
    if (!options.window_hu && seeds.empty() && is_bone_alone(before, mask.count()))
      throw_without_contrast(volume, name, device);
    give_lumen_back();
    check_seeds(seeds, mask, LostSeed::Cause::bone, name);
    heard.on_step("trabecular-bone", mask);
  }
  close_gaps(mask, candidates, progress);
  heard.on_step("gaps", mask);
  Mask vessels = select_vessels(mask, markers, name, progress);
  heard.on_step("selection", vessels);
  progress.begin("filling", 3, "passes");
  complete_lumen(scan, window, bright, bone, vessels, progress);
  heard.on_step("filling", vessels);
  return vessels;
}

}  // namespace xraycast
