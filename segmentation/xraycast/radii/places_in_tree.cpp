#include "xraycast/radii/places_in_tree.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/evidence/axes_across.hpp"
#include "xraycast/geometry/segment_index.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <numeric>
#include <utility>

namespace xraycast {
namespace {

// Lengths in voxels.
constexpr double kBeyond_vox = 4, kApart_vox = 1.5, kBetween_vox = 1.25, kWidest_vox = 20;
constexpr std::size_t kPlacesOfStretch = 12;

/// A line's direction and two across it, each of length one; any where a line turns back.
std::array<glm::dvec3, 3> frame_of(const glm::dvec3& along) {
  const double length = glm::length(along);
  const glm::dvec3 tangent = length > 0 ? along / length : glm::dvec3(0, 0, 1);
  const auto [u, v] = axes_across(tangent);
  return {tangent, u, v};
}

}  // namespace

PlacesInTree::PlacesInTree(const VesselTree& tree, const TubeQuestions& tubes)
    : branches_(tree.branches()), tubes_(tubes), places_(branches_.size()) {
  const double voxel_mm = tubes.voxel_mm();
  samples_ = tube_samples(tree, tubes.scan().volume,
                          {kBeyond_vox * voxel_mm, kApart_vox * voxel_mm, kWidest_vox * voxel_mm});
  double widest_mm = 0;
  for (const VesselBranch& branch : branches_)
    for (const VesselPoint& p : branch.points) widest_mm = std::max(widest_mm, p.radius_mm);
  parallel_for(std::ssize(branches_), [&](std::int64_t i) {
    const auto branch = static_cast<std::size_t>(i);
    add_places(branch, tree.segments(), widest_mm);
  });
  for (std::size_t b = 0; b < places_.size(); ++b)
    for (std::size_t i = 0; i < places_[b].size(); ++i)
      if (places_[b][i].is_alone) alone_.emplace_back(b, i);
  parallel_for(std::ssize(alone_), [&](std::int64_t i) {
    const auto [branch, place] = alone_[static_cast<std::size_t>(i)];
    centre(branch, places_[branch][place]);
  });
  cut_stretches();
}

void PlacesInTree::add_places(std::size_t branch, const SegmentIndex& segments, double widest_mm) {
  const double all_mm = branches_[branch].arc_length_mm.back();
  const auto count = static_cast<std::int64_t>(all_mm / (kBetween_vox * tubes_.voxel_mm())) + 1;
  for (std::int64_t k = 0; k < count; ++k) {
    PlaceInTree place =
        place_at(branches_[branch], (static_cast<double>(k) + 0.5) * all_mm / static_cast<double>(count));
    const glm::dvec3 at_mm = point_at(branches_[branch], place.along_mm).position_mm;
    const auto is_in_another = [&](const SegmentIndex::Nearest& near) {
      return near.segment.branch != static_cast<int>(branch) && near.out_mm() < 0;
    };
    place.is_alone = place.given_mm < kWidest_vox * tubes_.voxel_mm() &&
                     !segments.nearest(at_mm, widest_mm, is_in_another);
    places_[branch].push_back(place);
  }
}

PlaceInTree PlacesInTree::place_at(const VesselBranch& branch, double along_mm) const {
  constexpr double kHalf_vox = 2.5;
  const double half_mm = kHalf_vox * tubes_.voxel_mm();
  const glm::dvec3 before = point_at(branch, along_mm - half_mm).position_mm,
                   after = point_at(branch, along_mm + half_mm).position_mm;
  const auto [tangent, u, v] = frame_of(after - before);
  PlaceInTree place{along_mm, tangent, u, v, point_at(branch, along_mm).radius_mm};
  place.is_steady = is_steady(branch, place);
  return place;
}

/// Whether the given radius changes little within the window about a place, in which one radius is measured:
/// not in a short stenosis.
bool PlacesInTree::is_steady(const VesselBranch& branch, const PlaceInTree& place) const {
  constexpr double kMost_vox = 0.75, kOfRadius = 0.25;
  const double half_mm = tubes_.window_mm(place.given_mm);
  double low_mm = place.given_mm, high_mm = place.given_mm;
  for (auto i = std::ranges::lower_bound(branch.arc_length_mm, place.along_mm - half_mm) -
                branch.arc_length_mm.begin();
       i < std::ssize(branch.points); ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (branch.arc_length_mm[at] > place.along_mm + half_mm) break;
    low_mm = std::min(low_mm, branch.points[at].radius_mm);
    high_mm = std::max(high_mm, branch.points[at].radius_mm);
  }
  return high_mm - low_mm < kMost_vox * tubes_.voxel_mm() + kOfRadius * place.given_mm;
}

/// Places that follow each other, none of them in another branch, in stretches of about as many.
void PlacesInTree::cut_stretches() {
  for (std::size_t b = 0; b < branches_.size(); ++b) {
    std::vector<PlaceInTree>& places = places_[b];
    for (std::size_t first = 0; first < places.size();) {
      std::size_t last = first;
      while (last < places.size() && places[last].is_alone) ++last;
      const std::size_t count = last - first, parts = (count + kPlacesOfStretch - 1) / kPlacesOfStretch;
      for (std::size_t k = 0; k < parts; ++k)
        add_stretch(b, std::span(places).subspan(first + k * count / parts,
                                                 (k + 1) * count / parts - k * count / parts));
      first = last + 1;
    }
  }
}

void PlacesInTree::add_stretch(std::size_t branch, std::span<PlaceInTree> places) {
  glm::dvec3 along(0);
  double given_mm = 0;
  for (PlaceInTree& place : places) {
    place.stretch = stretches_.size();
    along += place.tangent;
    given_mm += place.given_mm / static_cast<double>(places.size());
  }
  const auto [tangent, u, v] = frame_of(along);
  const double half_mm = 0.5 * kBetween_vox * tubes_.voxel_mm();
  stretches_.push_back(
      {branch, places.front().along_mm - half_mm, places.back().along_mm + half_mm, given_mm, tangent, u, v});
}

/// Finds the middle of what the scan shows, whatever the radius.
void PlacesInTree::centre(std::size_t branch, PlaceInTree& place) const {
  constexpr double kBlur_vox = 0.5, kHalf_vox = 4;
  const std::vector<SampleAcross> samples = samples_about(branch, place, kHalf_vox * tubes_.voxel_mm());
  const auto guessed = tubes_.guess(samples, place.given_mm);
  if (!guessed) return;
  TubeQuestion q = tubes_.question(*guessed, tubes_.across_mm(kBlur_vox * tubes_.voxel_mm(), place.tangent),
                                   place.given_mm);
  q.radius = {place.given_mm, 0};
  q.off_x = q.off_y = {0, off_line_mm()};
  if (const auto found = fit_tube(samples, q))
    place.off_mm = found->tube.off_mm.x * place.u + found->tube.off_mm.y * place.v;
}

double PlacesInTree::off_line_mm() const {
  constexpr double kOff_vox = 0.35;
  return kOff_vox * tubes_.voxel_mm();
}

std::vector<Stretch> PlacesInTree::stretches() const {
  std::vector<Stretch> result;
  for (const StretchOfBranch& stretch : stretches_)
    result.push_back({stretch.tangent, stretch.given_mm, [this, &stretch] { return samples_of(stretch); }});
  return result;
}

/// Calls `visit` for samples of a stretch of a branch: of a wide one for as many as tell enough.
template <typename Visit>
void PlacesInTree::for_samples_between(std::size_t branch, double first_mm, double last_mm,
                                       const Visit& visit) const {
  constexpr std::ptrdiff_t kEnough = 2000;
  const std::vector<TubeSample>& all = samples_[branch];
  const auto first = std::ranges::lower_bound(all, first_mm, {}, &TubeSample::along_mm),
             last = std::ranges::upper_bound(all, last_mm, {}, &TubeSample::along_mm);
  const std::ptrdiff_t every = (last - first) / kEnough + 1;
  for (std::ptrdiff_t i = 0; i < last - first; i += every) visit(first[i]);
}

std::vector<SampleAcross> PlacesInTree::samples_about(std::size_t branch, const PlaceInTree& place,
                                                      double half_mm) const {
  std::vector<SampleAcross> result;
  const auto add = [&](const TubeSample& s) {
    const double along_mm = s.along_mm - place.along_mm;
    result.push_back({{glm::dot(s.from_axis_mm, place.u), glm::dot(s.from_axis_mm, place.v)},
                      along_mm,
                      1 - std::abs(along_mm) / half_mm,
                      s.hu});
  };
  for_samples_between(branch, place.along_mm - half_mm, place.along_mm + half_mm, add);
  return result;
}

/// The middle of what the scan shows beside a line.
glm::dvec3 PlacesInTree::off_mm(std::size_t branch, double along_mm) const {
  const std::vector<PlaceInTree>& places = places_[branch];
  const auto after = std::ranges::lower_bound(places, along_mm, {}, &PlaceInTree::along_mm);
  if (after == places.begin()) return places.front().off_mm;
  if (after == places.end()) return places.back().off_mm;
  const PlaceInTree &a = *std::prev(after), &b = *after;
  return glm::mix(a.off_mm, b.off_mm, (along_mm - a.along_mm) / (b.along_mm - a.along_mm));
}

/// The samples of a stretch by their distance from the middle.
std::vector<SampleAcross> PlacesInTree::samples_of(const StretchOfBranch& stretch) const {
  std::vector<SampleAcross> result;
  const double middle_mm = std::midpoint(stretch.first_mm, stretch.last_mm);
  const auto add = [&](const TubeSample& s) {
    const glm::dvec3 from = s.from_axis_mm - off_mm(stretch.branch, s.along_mm);
    const glm::dvec2 across(glm::dot(from, stretch.u), glm::dot(from, stretch.v));
    // In a bend, a stretch's frame is not that of each place.
    const double scale = glm::length(from) / std::max(glm::length(across), 1e-6);
    result.push_back({scale * across, s.along_mm - middle_mm, 1, s.hu});
  };
  for_samples_between(stretch.branch, stretch.first_mm, stretch.last_mm, add);
  return result;
}

}  // namespace xraycast
