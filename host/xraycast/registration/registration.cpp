#include "xraycast/registration/registration.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/registration/evolution_search.hpp"
#include "xraycast/registration/pose_candidates.hpp"
#include "xraycast/registration/pose_fit.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/trigonometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace xraycast {
namespace {

/// Pixels across the scan as a picture shows it, by level.
constexpr std::array kLevelPixels{56, 112, 224, 400};
constexpr std::size_t kLevels = kLevelPixels.size();

glm::dvec3 row(const glm::dmat3& matrix, int index) { return glm::transpose(matrix)[index]; }

/// Where a camera looks, in the scan's axes.
glm::dvec3 axis_of(const PinholeCamera& camera) { return row(camera.rotation, 2); }

PictureBox box_of(const std::vector<std::uint8_t>& mask, const Xray& xray) {
  PictureBox box{xray.width, xray.height, 0, 0};
  for (int y = 0; y < xray.height; ++y)
    for (int x = 0; x < xray.width; ++x) {
      if (mask[static_cast<std::size_t>(y) * static_cast<std::size_t>(xray.width) +
               static_cast<std::size_t>(x)] == 0)
        continue;
      box = {std::min(box.left, x), std::min(box.top, y), std::max(box.right, x + 1),
             std::max(box.bottom, y + 1)};
    }
  return box;
}

/// The part of a picture in which the scan may be shown.
struct Window {
  std::vector<std::uint8_t> mask;
  GreyRange range;
  PictureBox box;
  double pixel_mm;   ///< at the scan
  double scan_size;  ///< of the scan within the picture: the mean of width and height, in pixels
};

Window window_of(const Xray& xray, const RigidMotion& start, const AttenuationPyramid& scan,
                 const RegisterRequest& request, bool searches) {
  const PinholeCamera camera = seeing(xray.camera.value(), start);
  Window window{.mask = collimated_field(xray), .range = {}, .box = {}, .pixel_mm = 0, .scan_size = 0};
  window.range = grey_range(xray, window.mask);
  const PictureBox field = box_of(window.mask, xray);
  const double depth_mm = (camera.rotation * scan.middle_mm() + camera.translation_mm).z;
  if (!(depth_mm > 0))
    throw InputError(
        "{}: its camera does not look at the scan; RT must map the scan's mm to the camera's, "
        "which looks along its z",
        xray.name);
  const double focal = std::abs(camera.intrinsics[0][0]);
  window.pixel_mm = depth_mm / focal;
  const double reach_mm = searches ? request.search_mm + std::sin(glm::radians(request.search_deg)) * 0.5 *
                                                             glm::length(scan.upper_mm() - scan.lower_mm())
                                   : 5;
  glm::dvec2 low(1e30), high(-1e30);
  for (const glm::dvec3& corner : corners_of(scan.lower_mm(), scan.upper_mm())) {
    const glm::dvec3 seen = camera.rotation * corner + camera.translation_mm;
    if (!(seen.z > 0.1 * depth_mm)) {
      low = glm::dvec2(-1e30);
      high = glm::dvec2(1e30);
      break;
    }
    const glm::dvec3 at = camera.intrinsics * (seen / seen.z);
    low = glm::min(low, glm::dvec2(at));
    high = glm::max(high, glm::dvec2(at));
  }
  const double wide = std::min<double>(high.x - low.x, field.right - field.left),
               tall = std::min<double>(high.y - low.y, field.bottom - field.top);
  window.scan_size = std::sqrt(wide * tall);
  const double reach = reach_mm / window.pixel_mm;
  const auto within = [](double at, int first, int last) {
    return static_cast<int>(std::clamp(at, static_cast<double>(first), static_cast<double>(last)));
  };
  window.box = {within(low.x - reach, field.left, field.right),
                within(low.y - reach, field.top, field.bottom),
                within(high.x + reach + 1, field.left, field.right),
                within(high.y + reach + 1, field.top, field.bottom)};
  if (window.box.right - window.box.left < 16 || window.box.bottom - window.box.top < 16)
    throw InputError(
        "{}: the scan lies beside the picture, even within `search_mm` {:g}; give a start nearer to it",
        xray.name, request.search_mm);
  return window;
}

int factor_for(const Window& window, std::size_t level) {
  return std::max(1, static_cast<int>(std::lround(window.scan_size / kLevelPixels[level])));
}

/// How poses are sampled: from the cube of -1 to 1, about the scan as the first camera sees it.
class SearchRange {
 public:
  SearchRange(const RegisterRequest& request, std::span<const Xray> xrays, const RigidMotion& start,
              const glm::dvec3& middle_mm)
      : start_(start),
        first_(xrays[0].camera.value()),
        centre_mm_(start(middle_mm)),
        turn_rad_(glm::radians(request.search_deg)),
        aside_mm_(request.search_mm),
        towards_mm_(3 * request.search_mm) {
    constexpr double kFromTheSide = 0.87;  // 30 degrees
    for (const Xray& xray : xrays)
      if (std::abs(glm::dot(axis_of(*xray.camera), axis_of(first_))) < kFromTheSide) towards_mm_ = aside_mm_;
  }

  RigidMotion at(const std::vector<double>& point) const {
    const glm::dmat3 to_scan = glm::transpose(first_.rotation);
    const glm::dvec3 moved(aside_mm_ * point[0], aside_mm_ * point[1], towards_mm_ * point[2]),
        turned(turn_rad_ * point[3], turn_rad_ * point[4], turn_rad_ * point[5]);
    return turned_and_moved(to_scan * turned, to_scan * moved, centre_mm_).after(start_);
  }

 private:
  RigidMotion start_;
  PinholeCamera first_;
  glm::dvec3 centre_mm_;
  double turn_rad_, aside_mm_, towards_mm_;
};

/// Of the search, in its cube: nearer than this the refinement finds a pose without a search.
double precision_of(const RegisterRequest& request) {
  constexpr double kNear_deg = 0.45, kNear_mm = 1.2, kLeast = 0.03, kMost = 0.3;
  return std::clamp(std::min(kNear_deg / request.search_deg, kNear_mm / request.search_mm), kLeast, kMost);
}

}  // namespace

/// Of a refinement: at how fine a level, how many of the poses are kept, in how many steps, and whether the
/// tone curve is fitted to the best one then.
struct RefinementStage {
  std::size_t level;
  int kept, steps;
  bool fits_tones;
};

namespace {

constexpr std::array kCoarse{RefinementStage{0, 3, 12, false}, RefinementStage{1, 2, 12, true}};
// The finest level twice, so that its tone curve, and what counts as a large difference, are those of a pose
// nearby. A film's frame has them from the one before, and lies near it.
constexpr std::array kFine{RefinementStage{2, 1, 10, true}, RefinementStage{3, 1, 8, true},
                           RefinementStage{3, 1, 8, false}};
constexpr std::array kFilm{RefinementStage{1, 1, 6, true}, RefinementStage{2, 1, 5, true},
                           RefinementStage{3, 1, 1, false}};

constexpr int kGenerations = 40;
// A pose with less is not told from others, nor one of which another has so large a share.
constexpr double kLeastSimilarity = 0.2, kMostNextBest = 0.9;
constexpr double kApart_mm = 3;  // of two poses after a refinement

}  // namespace

/// X-rays, from coarse to fine.
struct Registrar::Prepared {
  std::span<const Xray> xrays;
  std::vector<Window> windows;
  std::vector<Tone> tones;
  std::vector<ToneCurve> curves;
  std::array<std::vector<ViewLevel>, kLevels> levels;  ///< of each the views
  std::int64_t projections = 0;

  void make_level(std::size_t level) {
    levels[level].clear();
    for (std::size_t v = 0; v < xrays.size(); ++v)
      levels[level].push_back(level_of(xrays[v], windows[v].mask, windows[v].range, windows[v].box,
                                       factor_for(windows[v], level), curves[v]));
  }

  void set_tone(Tone tone) {
    tones.assign(xrays.size(), tone);
    curves.assign(xrays.size(), ToneCurve(tone));
  }
};

void check(const RegisterRequest& request) {
  if (!(request.search_deg >= 0 && request.search_deg <= 180))
    throw InputError("`search_deg` {:g}: must be 0 to 180", request.search_deg);
  if (!(request.search_mm >= 0 && request.search_mm <= 1000))
    throw InputError("`search_mm` {:g}: must be 0 to 1000", request.search_mm);
}

Registrar::Registrar(ComputeDevice& device, const Volume& scan, std::span<const std::uint8_t> mask,
                     const RegisterRequest& request)
    : device_(device), scan_(scan), mask_(mask), request_(request) {
  check(request);
}

/// Voxels about as large as the pixels that are compared.
void Registrar::make_pyramid(const PinholeCamera& camera, Progress& progress) {
  const VolumeGeometry& grid = scan_.geometry();
  const glm::dvec3 middle = grid.middle_mm(), extent_mm = grid.upper_mm() - grid.lower_mm();
  const double depth_mm = std::max((camera.rotation * middle + camera.translation_mm).z, 1.0),
               field_mm = std::max(camera.width, camera.height) * depth_mm /
                          std::max(std::abs(camera.intrinsics[0][0]), 1e-9),
               size_mm = std::sqrt(std::max({extent_mm.x, extent_mm.y, extent_mm.z}) *
                                   std::min({extent_mm.x, extent_mm.y, extent_mm.z})),
               seen_mm = std::min(field_mm, size_mm);
  std::vector<double> spacings_mm;
  for (const int pixels : kLevelPixels) spacings_mm.push_back(seen_mm / pixels);
  pyramid_.emplace(device_, scan_, request_.opacity, mask_, spacings_mm, progress);
}

Registrar::Prepared Registrar::prepared(std::span<const Xray> xrays, const RigidMotion& start, bool searches,
                                        Progress& progress) {
  if (xrays.empty()) throw InputError("there is no X-ray to register");
  for (const Xray& xray : xrays) {
    check(xray);
    if (!xray.camera)
      throw InputError(
          "{}: nothing says how it was taken; give its camera, or angles and distances to start from",
          xray.name);
  }
  Prepared views;
  views.xrays = xrays;
  views.set_tone(Tone::log_intensity);
  if (!pyramid_) make_pyramid(seeing(*xrays[0].camera, start), progress);
  for (const Xray& xray : xrays)
    views.windows.push_back(window_of(xray, start, *pyramid_, request_, searches));
  return views;
}

/// Poses, the best first, after a refinement.
struct Registrar::Refinement {
  std::vector<PoseCandidate> candidates{};
  PoseFit::Refined last{};
  double first_similarity = 0;  ///< of the best one at the first level
  double next_best = 0;         ///< similarity of the second best pose, at the last level with several

  double similarity() const { return candidates.empty() ? -2 : candidates[0].similarity; }

  /// What fits by chance at the coarsest level fits worse at the next one, and still worse at the `finest`:
  /// on real X-rays of a forearm 75 to 90 % as well and then 55 to 78 %, where the bone itself fits a quarter
  /// better at the next one and then 84 to 87 % as well; inverted X-rays of chests 35 to 80 % as well at the
  /// next one, the right ones 97 % and then 86 to 91 %.
  bool stands_out_by(const Refinement& finest) const {
    constexpr double kKept = 0.9, kKeptByFinest = 0.8;
    return similarity() > kKept * first_similarity && finest.similarity() > kKeptByFinest * similarity() &&
           next_best < kMostNextBest * similarity() &&
           finest.next_best < kMostNextBest * finest.first_similarity;
  }

  /// Of two refinements to the same level the better one stays here. Whether it was the other.
  bool take_better(Refinement& other, const AttenuationPyramid& scan) {
    std::vector<PoseCandidate> all = candidates;
    all.insert(all.end(), other.candidates.begin(), other.candidates.end());
    all = distinct(std::move(all), kApart_mm, 2, scan);
    const bool is_other = other.similarity() > similarity();
    if (is_other) std::swap(*this, other);
    next_best = std::max(next_best, other.next_best);
    if (all.size() > 1) next_best = std::max(next_best, all[1].similarity);
    return is_other;
  }
};

/// At the coarsest level, in X-rays of one tone.
std::vector<PoseCandidate> Registrar::searched(Prepared& views, Tone tone, const RigidMotion& start,
                                               int number, Progress& progress) const {
  const SearchRange range(request_, views.xrays, start, pyramid_->middle_mm());
  views.set_tone(tone);
  views.make_level(0);
  const PoseFit fit(pyramid_->level(0), views.levels[0]);
  Progress quiet;
  const auto similarities = [&](std::span<const std::vector<double>> points) {
    progress.advance();
    std::vector<RigidMotion> motions;
    for (const std::vector<double>& point : points) motions.push_back(range.at(point));
    return fit.similarities(motions, quiet);
  };
  EvolutionOptions options;
  options.generations = kGenerations;
  options.precision = precision_of(request_);
  options.seed = request_.seed + static_cast<std::uint64_t>(number);
  std::vector<PoseCandidate> candidates;
  for (const Optimum& optimum : search_by_evolution(options, similarities))
    candidates.push_back({range.at(optimum.point), optimum.value});
  views.projections += fit.projections();
  constexpr double kApartShare = 0.03;  // of the scan's diagonal
  constexpr std::size_t kMost = 6;
  const double apart_mm = kApartShare * glm::length(pyramid_->upper_mm() - pyramid_->lower_mm());
  return distinct(std::move(candidates), apart_mm, kMost, *pyramid_);
}

/// One search in X-rays in which bone is dark, and one in inverted ones. What fits better than `best` takes
/// its place, with the tones that it fits.
bool Registrar::search(Prepared& views, const RigidMotion& start, int number, Refinement& best,
                       Progress& progress) const {
  std::vector<Tone> tones = views.tones;
  std::vector<ToneCurve> curves = views.curves;
  bool is_better = false;
  for (const Tone tone : {Tone::log_intensity, Tone::inverted_log_intensity}) {
    std::vector<PoseCandidate> candidates = searched(views, tone, start, number, progress);
    choose_tones(views, candidates.front().motion);
    Refinement one = refined(views, std::move(candidates), kCoarse, progress);
    if (!best.take_better(one, *pyramid_)) continue;
    is_better = true;
    tones = views.tones;
    curves = views.curves;
  }
  views.tones = tones;
  views.curves = curves;
  return is_better;
}

/// Until a pose stands out.
Registration Registrar::searched_for(Prepared& views, const RigidMotion& start, Progress& progress) const {
  constexpr int kMost = 4;
  constexpr std::int64_t kEach = 2 * (kGenerations + std::ssize(kCoarse)) + std::ssize(kFine);
  progress.begin("searching", kMost * kEach, "steps");
  Refinement best, finest;
  Registration found;
  for (int n = 0; n < kMost && !found.is_sure; ++n) {
    if (!search(views, start, n, best, progress)) continue;
    Refinement fine = refined(views, best.candidates, kFine, progress);
    if (fine.similarity() <= finest.similarity()) continue;
    found = told(views, fine.last);
    if (found.is_sure && !best.stands_out_by(fine)) {
      found.is_sure = false;
      found.notes.emplace_back(
          "another pose fits nearly as well, or this one by chance: look at the overlay, and give another "
          "view or a nearer start");
    }
    finest = std::move(fine);
  }
  return found;
}

Registration Registrar::refined_from(Prepared& views, const RigidMotion& start, Progress& progress) const {
  progress.begin("refining", std::ssize(kCoarse) + std::ssize(kFine), "levels");
  choose_tones(views, start);
  Refinement coarse = refined(views, {{start}}, kCoarse, progress);
  return told(views, refined(views, std::move(coarse.candidates), kFine, progress).last);
}

void Registrar::choose_tones(Prepared& views, const RigidMotion& motion) const {
  Progress quiet;
  for (std::size_t v = 0; v < views.xrays.size(); ++v) {
    double best = -2;
    for (const Tone tone : kTones) {
      const Window& window = views.windows[v];
      const ViewLevel level = level_of(views.xrays[v], window.mask, window.range, window.box,
                                       factor_for(window, 0), ToneCurve(tone));
      const PoseFit fit(pyramid_->level(0), std::span(&level, 1));
      const double value = fit.similarities(std::span(&motion, 1), quiet)[0];
      views.projections += fit.projections();
      if (value <= best) continue;
      best = value;
      views.tones[v] = tone;
      views.curves[v] = ToneCurve(tone);
    }
  }
}

Registrar::Refinement Registrar::refined(Prepared& views, std::vector<PoseCandidate> candidates,
                                         std::span<const RefinementStage> stages, Progress& progress) const {
  Refinement refinement;
  Progress quiet;
  for (const RefinementStage& stage : stages) {
    views.make_level(stage.level);
    const PoseFit fit(pyramid_->level(stage.level), views.levels[stage.level]);
    for (PoseCandidate& candidate : candidates) {
      refinement.last = fit.refine(candidate.motion, stage.steps, quiet);
      candidate = {refinement.last.motion, refinement.last.similarity()};
      progress.check();
    }
    const bool are_several = candidates.size() > 1;
    candidates = distinct(std::move(candidates), kApart_mm, static_cast<std::size_t>(std::max(stage.kept, 2)),
                          *pyramid_);
    if (&stage == stages.data()) refinement.first_similarity = candidates[0].similarity;
    // The finest level at which several were tried: there the right one stands out most.
    if (are_several) refinement.next_best = candidates.size() > 1 ? candidates[1].similarity : 0;
    if (std::ssize(candidates) > stage.kept)
      candidates.erase(candidates.begin() + stage.kept, candidates.end());
    if (stage.fits_tones) views.curves = fit.tones_at(candidates[0].motion, views.curves, quiet);
    views.projections += fit.projections();
    progress.advance();
  }
  refinement.candidates = std::move(candidates);
  return refinement;
}

Registration Registrar::told(const Prepared& views, const PoseFit::Refined& pose) const {
  Registration found;
  found.motion = pose.motion;
  for (std::size_t v = 0; v < views.xrays.size(); ++v) {
    const PinholeCamera camera = seeing(*views.xrays[v].camera, pose.motion);
    const glm::dvec3 towards = axis_of(camera);
    found.views.push_back({.image = views.xrays[v].name,
                           .camera = camera,
                           .lao_rad = std::atan2(towards.x, -towards.y),
                           .cranial_rad = std::asin(std::clamp(towards.z, -1.0, 1.0)),
                           .similarity = pose.similarities[v],
                           .tone = views.tones[v],
                           .curve = views.curves[v]});
  }
  const glm::dvec3 sd_mm(pose.sd[0], pose.sd[1], pose.sd[2]), sd_rad(pose.sd[3], pose.sd[4], pose.sd[5]);
  const glm::dvec3 half_2 = glm::pow(0.5 * (pyramid_->upper_mm() - pyramid_->lower_mm()), glm::dvec3(2));
  const glm::dvec3 lever_2(half_2.y + half_2.z, half_2.x + half_2.z, half_2.x + half_2.y);
  found.sd_mm = glm::length(sd_mm);
  found.sd_deg = glm::degrees(glm::length(sd_rad));
  found.rms_mm = std::sqrt(glm::dot(sd_mm, sd_mm) + glm::dot(sd_rad * sd_rad, lever_2));
  found.evaluations = views.projections;
  found.is_sure = pose.similarity() > kLeastSimilarity;
  if (!found.is_sure)
    found.notes.push_back(
        fmt::format("the X-rays and the projections hardly agree (similarity {:.2f}), so the pose is not to "
                    "be relied on: look at the overlay, and start nearer or search farther",
                    pose.similarity()));
  return found;
}

Registration Registrar::find(std::span<const Xray> xrays, Progress& progress) {
  return find(xrays, request_.start, progress);
}

Registration Registrar::find(std::span<const Xray> xrays, const RigidMotion& start, Progress& progress) {
  const Stopwatch stopwatch;
  const bool searches = request_.search_mm > 0 || request_.search_deg > 0;
  Prepared views = prepared(xrays, start, searches, progress);
  Registration found = searches ? searched_for(views, start, progress) : refined_from(views, start, progress);
  found.seconds = 1e-3 * stopwatch.ms();
  return found;
}

Registration Registrar::follow(std::span<const Xray> xrays, const Registration& last, Progress& progress) {
  const Stopwatch stopwatch;
  Prepared views = prepared(xrays, last.motion, false, progress);
  for (std::size_t v = 0; v < xrays.size() && v < last.views.size(); ++v) {
    views.tones[v] = last.views[v].tone;
    views.curves[v] = last.views[v].curve;
  }
  progress.begin("refining", std::ssize(kFilm), "levels");
  Registration found = told(views, refined(views, {{last.motion}}, kFilm, progress).last);
  constexpr double kLeastShare = 0.7;  // of the similarity before; below, the pose was lost
  const auto sum = [](const Registration& pose) {
    double similarities = 0;
    for (const Registration::View& view : pose.views) similarities += view.similarity;
    return similarities;
  };
  if (sum(found) < kLeastShare * sum(last)) return find(xrays, last.motion, progress);
  found.seconds = 1e-3 * stopwatch.ms();
  return found;
}

std::vector<Registration> Registrar::track(std::span<const std::vector<Xray>> frames, Progress& progress) {
  std::vector<Registration> found;
  for (const std::vector<Xray>& xrays : frames)
    found.push_back(found.empty() ? find(xrays, progress) : follow(xrays, found.back(), progress));
  return found;
}

std::vector<std::string> notes_of(std::span<const Registration> frames) {
  std::vector<std::string> notes;
  for (const Registration& frame : frames)
    for (const std::string& note : frame.notes)
      if (std::ranges::find(notes, note) == notes.end()) notes.push_back(note);
  return notes;
}

}  // namespace xraycast
