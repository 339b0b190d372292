#include "xraycast/segmentation/segment.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/evidence/thin_branches.hpp"
#include "xraycast/evidence/vessel_evidence.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/mask/morphology.hpp"
#include "xraycast/segmentation/body_mask.hpp"
#include "xraycast/segmentation/bone.hpp"
#include "xraycast/segmentation/candidates.hpp"
#include "xraycast/segmentation/denoise.hpp"
#include "xraycast/segmentation/gap_closing.hpp"
#include "xraycast/segmentation/lumen_completion.hpp"
#include "xraycast/segmentation/other_vessels.hpp"
#include "xraycast/segmentation/seeds.hpp"
#include "xraycast/segmentation/trabecular_bone.hpp"
#include "xraycast/segmentation/vessel_selection.hpp"

#include <glm/common.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

constexpr std::int64_t kMinSlices = 10;

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

void check(const Volume& volume, const SegmentRequest& request, const std::string& name) {
  const VolumeGeometry& g = volume.geometry();
  if (g.size.z < kMinSlices)
    throw InputError("{}: {}, too few to follow vessels; at least {} are needed", name,
                     pluralize(g.size.z, "slice"), kMinSlices);
  for (const auto* points : {&request.markers.vessels_mm, &request.markers.not_vessels_mm})
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

void explain(const SegmentRequest& request, const std::string& step, const Mask& mask) {
  if (request.explain) request.explain(step, mask);
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
  throw InputError(
      "{}: no vessel: the scan seems to hold no contrast agent; give a seed, a point in a vessel{}{}; check "
      "in "
      "the scan which are vessels, and give one by `seeds`, or a mask by `from_mask`",
      name, places.empty() ? "" : "; the brightest candidates are ", places);
}

/// The great vessel to begin with where a scan's histogram shows none, or brighter ones: then the aorta, if
/// all that were found are darker than those. An aorta full of contrast agent is none of them.
std::optional<GreatVessel> darker_great_vessel(const Volume& volume,
                                               const std::optional<Contrast>& contrast) {
  const std::vector<GreatVessel> found = find_great_vessels(volume);
  if (found.empty()) return std::nullopt;
  const auto is_seen = [&](const GreatVessel& vessel) { return vessel.hu >= window_of(*contrast).low_hu; };
  if (contrast && (found.front().name != "aorta" || std::ranges::any_of(found, is_seen))) return std::nullopt;
  return found.front();
}

/// `scan` is denoised.
ChosenWindow choose_window(const Volume& scan, const std::optional<Contrast>& contrast,
                           const std::vector<Seed>& seeds, const std::string& name) {
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

/// Vessels of a scan that shows nothing else bright, however thin, by the evidence of lumen in its voxels.
SegmentedVessels segment_by_evidence(const Volume& volume, const SegmentRequest& request,
                                     const std::string& name, ComputeDevice& device, Progress& progress,
                                     SegmentLog& log) {
  Markers markers = request.markers;
  auto [mask, fill, scale] = vessel_evidence(volume, log.noise_hu, device, progress);
  log.scale = scale;
  log.noise_hu = scale.noise_hu;
  explain(request, "evidence", mask);
  if (mask.count() == 0) {
    constexpr int kAlike_hu = 10;
    const auto [lowest, highest] = std::ranges::minmax(volume.hu());
    if (highest - lowest < kAlike_hu)
      throw InputError("{}: no vessel: all voxels have about {} HU; give a scan that shows vessels", name,
                       lowest);
    throw InputError(
        "{}: no vessel: no bright structure stands out from the noise; give a scan with less noise, or by "
        "`window_hu` the window of the vessels' CT numbers",
        name);
  }
  if (markers.vessels_mm.empty() && markers.not_vessels_mm.empty()) {
    mask = without_small_components(mask);
  } else {
    take_off_other_vessels(mask, markers, name);
    separate_chambers(mask, markers, name, progress);
    explain(request, "chambers", mask);
    mask = select_vessels(mask, markers, name, progress);
  }
  explain(request, "selection", mask);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i)
    if (mask.voxels[i] == 0) fill.fractions[i] = 0;
  return {std::move(mask), std::move(fill)};
}

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
  Mask all_bone = bone;
  unite(all_bone, trabecular);
  remove_marrow(mask, all_bone);
  progress.advance();
  remove_thin_components(mask);
  progress.advance();
}

/// The rim of a lumen, its dense wall and its holes.
void complete_lumen(const Volume& scan, const ChosenWindow& window, const Mask& bright, const Mask& bone,
                    Mask& vessels, Progress& progress) {
  if (window.is_of_seeds) {
    Mask denser = between(scan, window.hu.high_hu, kMaxHu);
    unite(denser, bone);
    add_half_filled_rim(scan, denser, vessels);
  } else {
    add_partial_volume_rim(bright, vessels);
  }
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

/// Everything within the window.
Mask bright_voxels(const Volume& scan, const ChosenWindow& window, const std::string& name) {
  Mask mask =
      window.is_of_seeds ? between(scan, window.hu.low_hu, window.hu.high_hu) : threshold(scan, window.hu);
  if (2 * mask.count() > scan.geometry().voxel_count())
    throw InputError(
        "{}: no vessel: more than half of the scan lies above {:.0f} HU; give the window of the vessels' CT "
        "numbers by `window_hu`",
        name, window.hu.low_hu);
  return mask;
}

/// The steps for a scan that shows more than vessels, or whose window is given, in the order of their calls.
class ThresholdSteps {
 public:
  /// `quiet` is the denoised scan, if it needs that.
  ThresholdSteps(const Volume& volume, std::optional<Volume> quiet, const SegmentRequest& request,
                 const std::string& name, ComputeDevice& device, Progress& progress, SegmentLog& log)
      : request_(request),
        name_(name),
        device_(device),
        progress_(progress),
        log_(log),
        volume_(volume),
        quiet_(std::move(quiet)),
        is_subtracted_(!has_air(denoised_scan())),
        markers_(request.markers) {}

  Mask vessels() {
    try {
      return after_all_steps();
    } catch (const InputError&) {
      if (!log_.own_seed) throw;  // of a seed that nobody has given there is nothing to say
    }
    leave_own_seed_out();
    return after_all_steps();
  }

 private:
  Mask after_all_steps() {
    choose_scan_and_window();
    threshold_body();
    if (is_subtracted_ && markers().vessels_mm.empty() && markers().not_vessels_mm.empty()) {
      mask_ = without_small_components(mask_);  // only vessels remain in a subtracted scan
      explain(request_, "selection", mask_);
      return std::move(mask_);
    }
    find_lumen_at_seeds();
    remove_bone();
    remove_other_vessels();
    remove_chambers();
    remove_trabecular();
    return selected();
  }

  const Markers& markers() const { return markers_; }
  const Volume& denoised_scan() const { return quiet_ ? *quiet_ : volume_; }
  const Volume& at_seeds() const { return smooth_ ? *smooth_ : denoised_scan(); }
  const Volume& scan() const { return window_.is_of_seeds ? at_seeds() : denoised_scan(); }

  void give_lumen_back() {
    if (!seeds_.empty()) unite(mask_, lumen_);
  }

  void finish_step(const std::string& step, Removal removal) {
    check_seeds(seeds_, mask_, removal, name_);
    explain(request_, step, mask_);
  }

  void choose_scan_and_window() {
    std::optional<Contrast> contrast;
    if (!request_.window_hu) {
      contrast = find_contrast(denoised_scan(), name_, progress_);
      if (seeks_own_seed_ && !is_subtracted_ && markers().vessels_mm.empty() &&
          markers().not_vessels_mm.empty())
        seed_great_vessel(contrast);
    }
    if (!markers().vessels_mm.empty()) smooth_ = smoothed_for_seeds(volume_, device_);
    if (!is_subtracted_) seeds_ = look_at_seeds(at_seeds(), markers());
    if (request_.window_hu)
      window_ = {{request_.window_hu->first, request_.window_hu->first, request_.window_hu->second}, false};
    else if (!contrast && seeds_.empty())
      throw_without_contrast(volume_, name_, device_);
    else
      window_ = choose_window(denoised_scan(), contrast, seeds_, name_);
    log_.window = window_.hu;
    log_.is_window_of_seeds = window_.is_of_seeds;
  }

  void leave_own_seed_out() {
    seeks_own_seed_ = false;
    log_.own_seed.reset();
    markers_.vessels_mm.clear();
    smooth_.reset();
    seeds_.clear();
  }

  void seed_great_vessel(const std::optional<Contrast>& contrast) {
    log_.own_seed = darker_great_vessel(volume_, contrast);
    if (log_.own_seed) markers_.vessels_mm = {log_.own_seed->middle_mm};
  }

  void threshold_body() {
    progress_.begin("thresholding", 1, "scans");
    mask_ = bright_voxels(scan(), window_, name_);
    finish_step("window", request_.window_hu ? Removal::given_window : Removal::window);
    if (!is_subtracted_) {
      body_ = find_body_mask(scan());
      intersect(mask_, body_);
      finish_step("body", Removal::body);
    }
    progress_.advance();
  }

  void find_lumen_at_seeds() {
    lumen_ = lumen_at_seeds(at_seeds(), seeds_, window_.hu, body_, markers(), name_);
    give_lumen_back();
    body_ = Mask(VolumeGeometry{});  // a byte a voxel
    bright_ = mask_;
  }

  void remove_bone() {
    bone_ = is_subtracted_ ? Mask(mask_.geometry) : find_bone(scan(), window_.hu, bright_, progress_);
    subtract(mask_, bone_);
    give_lumen_back();
    finish_step("bone", Removal::bone);
  }

  void remove_other_vessels() {
    others_ = take_off_other_vessels(mask_, markers_, name_);
    if (others_.count() == 0) return;
    subtract(lumen_, others_);
    explain(request_, "other-vessels", mask_);
  }

  void remove_chambers() {
    separate_chambers(mask_, live(markers(), bright_, mask_, name_), name_, progress_);
    give_lumen_back();
    finish_step("chambers", Removal::chamber);
  }

  void remove_trabecular() {
    progress_.begin("removing trabecular bone", 7, "passes");
    candidates_ = mask_;
    if (is_subtracted_) return;
    constexpr double kBeside_mm = 3;
    intersect(candidates_, dilated_by_cylinder(bone_, kBeside_mm));
    progress_.advance();
    const std::int64_t before = mask_.count();
    remove_trabecular_bone(mask_, bone_, progress_);
    if (!request_.window_hu && seeds_.empty() && is_bone_alone(before, mask_.count()))
      throw_without_contrast(volume_, name_, device_);
    give_lumen_back();
    finish_step("trabecular-bone", Removal::bone);
  }

  Mask selected() {
    close_gaps(mask_, candidates_, progress_);
    explain(request_, "gaps", mask_);
    Mask vessels = select_vessels(mask_, markers(), name_, progress_);
    explain(request_, "selection", vessels);
    progress_.begin("filling", 3, "passes");
    complete_lumen(scan(), window_, bright_, bone_, vessels, progress_);
    if (others_.count() > 0) subtract(vessels, others_);
    explain(request_, "filling", vessels);
    if (window_.is_of_seeds) {
      add_thin_branches(vessels);
      explain(request_, "thin-branches", vessels);
    }
    return vessels;
  }

  /// Those that are darker than the seeds' window, as blur leaves them.
  void add_thin_branches(Mask& vessels) {
    // Of the contrast to soft tissue: what is darker is no other vessel but an organ, such as the liver,
    // through which arteries pass.
    constexpr double kDarker = 0.3;
    const double lumen_hu = std::ranges::min(seeds_, {}, &Seed::hu).hu,
                 others_hu = lumen_hu - kDarker * (lumen_hu - kSoftTissue_hu);
    const Mask bone = dilated(bone_, Sharing::corner);
    auto [branches, others] = find_thin_branches(
        volume_, {vessels, bone, left_out(vessels), lumen_hu, kSoftTissue_hu, others_hu}, device_, progress_);
    others = dilated(others, Sharing::corner);
    subtract(others, branches);
    unite(others, bone);
    add_half_filled_rim(scan(), others, branches);
    unite(vessels, branches);
  }

  /// What is bright about points that are in no vessel.
  Mask left_out(const Mask& vessels) const {
    Mask out(vessels.geometry);
    if (request_.markers.not_vessels_mm.empty()) return out;
    Mask rest = bright_;
    subtract(rest, dilated(vessels, Sharing::corner));
    for (const glm::dvec3& p : request_.markers.not_vessels_mm) unite(out, structure_at(rest, p));
    return out;
  }

  const SegmentRequest& request_;
  const std::string& name_;
  ComputeDevice& device_;
  Progress& progress_;
  SegmentLog& log_;
  const Volume& volume_;
  std::optional<Volume> quiet_, smooth_;
  bool is_subtracted_;
  bool seeks_own_seed_ = true;
  Markers markers_;  ///< of the request, and a seed of its own
  std::vector<Seed> seeds_;
  ChosenWindow window_{};
  Mask mask_{VolumeGeometry{}}, body_{VolumeGeometry{}}, lumen_{VolumeGeometry{}}, bright_{VolumeGeometry{}},
      bone_{VolumeGeometry{}}, others_{VolumeGeometry{}}, candidates_{VolumeGeometry{}};
};

/// Whether nothing but vessels is bright: there is no air around a body, or noise hides it.
bool shows_vessels_alone(const Volume& volume, const std::optional<Volume>& quiet, double noise_hu) {
  constexpr double kHides = 0.1;  // of the scan's range
  const auto [lowest, highest] = std::ranges::minmax(volume.hu());
  return noise_hu > kHides * (highest - lowest) || !has_air(quiet ? *quiet : volume);
}

}  // namespace

SegmentedVessels segment_vessels(const Volume& volume, const SegmentRequest& request, const std::string& name,
                                 ComputeDevice& device, Progress& progress, SegmentLog* log) {
  SegmentLog unheard;
  SegmentLog& heard = log != nullptr ? *log : unheard;
  check(volume, request, name);
  progress.begin("contrast", 5, "passes");
  heard.noise_hu = measure_noise_hu(volume);
  progress.advance();
  std::optional<Volume> quiet = denoised(volume, device);
  progress.advance();
  if (!request.window_hu && shows_vessels_alone(volume, quiet, heard.noise_hu))
    return segment_by_evidence(volume, request, name, device, progress, heard);
  Mask mask = ThresholdSteps(volume, std::move(quiet), request, name, device, progress, heard).vessels();
  LumenFill fill = fill_of(volume, mask);
  return {std::move(mask), std::move(fill)};
}

}  // namespace xraycast
