#include "xraycast/radii/image_radii.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/radii/places_in_tree.hpp"
#include "xraycast/radii/tube_fit.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace xraycast {
namespace {

/// A place and the radius that was found there.
struct Measured {
  double along_mm, given_mm;
  bool is_alone;
  double radius_mm = 0;  ///< zero where none was found

  bool is_found() const { return radius_mm > 0; }
};

class ImageRadii {
 public:
  ImageRadii(const VesselTree& tree, const TubeQuestions& tubes, const PlacesInTree& places,
             const LumenBrightness& brightness)
      : branches_(tree.branches()), tubes_(tubes), places_(places), brightness_(brightness) {}

  std::vector<VesselBranch> branches() const {
    std::vector<std::vector<Measured>> measured(branches_.size());
    for (std::size_t b = 0; b < branches_.size(); ++b)
      for (const PlaceInTree& place : places_.on(b))
        measured[b].push_back({place.along_mm, place.given_mm, place.is_alone});
    const auto& alone = places_.alone();
    parallel_for(std::ssize(alone), [&](std::int64_t i) {
      const auto [branch, place] = alone[static_cast<std::size_t>(i)];
      measured[branch][place].radius_mm = radius_mm(branch, places_.on(branch)[place]);
    });
    std::vector<VesselBranch> result = branches_;
    for (std::size_t b = 0; b < result.size(); ++b) set_radii(measured[b], result[b]);
    return result;
  }

 private:
  /// Zero where the scan does not show one.
  double radius_mm(std::size_t branch, const PlaceInTree& place) const {
    if (!place.is_steady || !tubes_.is_round(brightness_.blur_mm, place.u, place.v)) return 0;
    const std::vector<SampleAcross> samples =
        places_.samples_about(branch, place, tubes_.window_mm(place.given_mm));
    const auto guessed = tubes_.guess(samples, place.given_mm);
    if (!guessed) return 0;
    TubeQuestion q =
        tubes_.question(*guessed, tubes_.across_mm(brightness_.blur_mm, place.tangent), place.given_mm);
    q.lumen = brightness_.on(place.stretch);
    q.start.lumen_hu = q.lumen.mean;
    q.start.off_mm = {glm::dot(place.off_mm, place.u), glm::dot(place.off_mm, place.v)};
    q.off_x = {q.start.off_mm.x, places_.off_line_mm()};
    q.off_y = {q.start.off_mm.y, places_.off_line_mm()};
    const auto found = fit_tube(samples, q);
    return found && is_plausible(place, *found) ? found->tube.radius_mm : 0;
  }

  bool is_plausible(const PlaceInTree& place, const TubeAnswer& found) const {
    constexpr double kMost_vox = 0.5, kOfRadius = 1.0 / 3, kSure_vox = 0.3, kSure = 0.1;
    const double voxel_mm = tubes_.voxel_mm(), given_mm = place.given_mm;
    return tubes_.is_explained(found) &&
           std::abs(found.tube.radius_mm - given_mm) < kMost_vox * voxel_mm + kOfRadius * given_mm &&
           found.radius_deviation_mm * tubes_.misfit(found) < kSure_vox * voxel_mm + kSure * given_mm;
  }

  /// The change of the radius at each place, of what was found there or near it: it fades within 15 voxels,
  /// but not within another branch, where the given radius is that outside.
  std::vector<double> changes_mm(const std::vector<Measured>& places) const {
    std::vector<Carried> from_before = carried(places.begin(), places.end()),
                         from_after = carried(places.rbegin(), places.rend());
    std::ranges::reverse(from_after);
    std::vector<double> changes(places.size());
    for (std::size_t i = 0; i < places.size(); ++i) {
      const auto [before_mm, before] = from_before[i];
      const auto [after_mm, after] = from_after[i];
      const double both = before + after;
      changes[i] = both > 0 ? std::lerp(before_mm, after_mm, before / both) : before_mm;
    }
    return changes;
  }

  /// A change, and from how many places away it was carried.
  struct Carried {
    double change_mm, places;
  };

  template <typename Iterator>
  static std::vector<Carried> carried(Iterator first, Iterator last) {
    constexpr double kFull = 6, kGone = 12;  // places
    std::vector<Carried> result;
    double change_mm = 0, away = kGone, faded = kGone;
    for (; first != last; ++first) {
      if (first->is_found()) {
        change_mm = first->radius_mm - first->given_mm;
        away = faded = 0;
      } else {
        ++away;
        if (first->is_alone) ++faded;
      }
      result.push_back({change_mm * std::clamp((kGone - faded) / (kGone - kFull), 0.0, 1.0), away});
    }
    return result;
  }

  /// The radius runs straight from place to place.
  void set_radii(const std::vector<Measured>& places, VesselBranch& branch) const {
    constexpr double kLeast = 0.5;  // of the given one, where it was not found
    if (std::ranges::none_of(places, &Measured::is_found)) return;
    const std::vector<double> changes = changes_mm(places);
    for (std::size_t i = 0; i < branch.points.size(); ++i) {
      const double along_mm = branch.arc_length_mm[i];
      double& radius_mm = branch.points[i].radius_mm;
      const auto after = std::clamp<std::ptrdiff_t>(
          std::ranges::lower_bound(places, along_mm, {}, &Measured::along_mm) - places.begin(), 1,
          std::max<std::ptrdiff_t>(std::ssize(places) - 1, 1));
      const auto b = static_cast<std::size_t>(std::min(after, std::ssize(places) - 1)),
                 a = static_cast<std::size_t>(after - 1);
      const double apart_mm = places[b].along_mm - places[a].along_mm,
                   t = apart_mm > 0 ? std::clamp((along_mm - places[a].along_mm) / apart_mm, 0.0, 1.0) : 0;
      const bool is_between = t > 0 && t < 1 && places[a].is_found() && places[b].is_found();
      radius_mm = is_between ? std::lerp(places[a].radius_mm, places[b].radius_mm, t)
                             : std::max(radius_mm + std::lerp(changes[a], changes[b], t), kLeast * radius_mm);
    }
  }

  const std::vector<VesselBranch>& branches_;
  const TubeQuestions& tubes_;
  const PlacesInTree& places_;
  const LumenBrightness& brightness_;
};

}  // namespace

MeasuredTree with_image_radii(const VesselTree& tree, const ScanOfVessels& scan, const std::string& name,
                              Progress& progress) {
  progress.begin("measuring radii", 3, "passes");
  const TubeQuestions tubes(scan);
  const PlacesInTree places(tree, tubes);
  progress.advance();
  std::optional<LumenBrightness> brightness = measure_brightness(tubes, places.stretches());
  progress.advance();
  MeasuredTree result{tree, std::move(brightness)};
  if (result.brightness)
    result.tree = VesselTree(ImageRadii(tree, tubes, places, *result.brightness).branches(), name);
  progress.advance();
  return result;
}

}  // namespace xraycast
