#pragma once

#include "xraycast/geometry/segment_index.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/radii/lumen_brightness.hpp"
#include "xraycast/radii/tube_questions.hpp"
#include "xraycast/radii/tube_samples.hpp"

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace xraycast {

/// A place of a branch where its radius is measured.
struct PlaceInTree {
  double along_mm;
  glm::dvec3 tangent, u, v;    ///< an orthonormal frame
  double given_mm;             ///< the radius there
  bool is_alone = false;       ///< in no other branch, and not too wide
  bool is_steady = false;      ///< the given radius changes little about it
  std::size_t stretch = 0;     ///< of those that are alone
  glm::dvec3 off_mm{0, 0, 0};  ///< from the line to the middle of what the scan shows, across
};

/// The places of a tree where radii are measured, a voxel and a quarter apart on each branch, the stretches
/// of a dozen of them that follow each other, and what the scan shows about both.
class PlacesInTree {
 public:
  /// Both live longer than this.
  PlacesInTree(const VesselTree& tree, const TubeQuestions& tubes);
  PlacesInTree(const PlacesInTree&) = delete;  // stretches point into it
  PlacesInTree& operator=(const PlacesInTree&) = delete;

  const std::vector<PlaceInTree>& on(std::size_t branch) const { return places_[branch]; }

  /// Branches and places of all that are in no other branch.
  const std::vector<std::pair<std::size_t, std::size_t>>& alone() const { return alone_; }

  /// The stretches, in the order that places count them in; their samples need these places.
  std::vector<Stretch> stretches() const;

  /// The samples about a place, in its frame, weighted less the farther along the line they are.
  std::vector<SampleAcross> samples_about(std::size_t branch, const PlaceInTree& place, double half_mm) const;

  /// How far a line is off the middle, in one direction across; the standard deviation.
  double off_line_mm() const;

 private:
  struct StretchOfBranch {
    std::size_t branch;
    double first_mm, last_mm;
    double given_mm;           ///< the mean radius
    glm::dvec3 tangent, u, v;  ///< as of a place
  };

  void add_places(std::size_t branch, const SegmentIndex& segments, double widest_mm);
  PlaceInTree place_at(const VesselBranch& branch, double along_mm) const;
  bool is_steady(const VesselBranch& branch, const PlaceInTree& place) const;
  void cut_stretches();
  void add_stretch(std::size_t branch, std::span<PlaceInTree> places);
  void centre(std::size_t branch, PlaceInTree& place) const;
  glm::dvec3 off_mm(std::size_t branch, double along_mm) const;
  std::vector<SampleAcross> samples_of(const StretchOfBranch& stretch) const;
  template <typename Visit>
  void for_samples_between(std::size_t branch, double first_mm, double last_mm, const Visit& visit) const;

  const std::vector<VesselBranch>& branches_;
  const TubeQuestions& tubes_;
  std::vector<std::vector<TubeSample>> samples_;  ///< of each branch
  std::vector<std::vector<PlaceInTree>> places_;  ///< of each branch
  std::vector<std::pair<std::size_t, std::size_t>> alone_;
  std::vector<StretchOfBranch> stretches_;
};

}  // namespace xraycast
