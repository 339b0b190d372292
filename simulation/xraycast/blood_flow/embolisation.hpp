#pragma once

#include "xraycast/geometry/vessel_tree.hpp"

#include <cstddef>
#include <string>
#include <vector>

namespace xraycast {

struct RestFlow;

/// Spheres of one size in what is injected, which close the arterioles that they do not pass.
struct Particles {
  static constexpr double kLeast_mm = 0.1, kMost_mm = 1.2;  ///< microspheres on the market
  /// Of the injected volume: 2 ml of loose spheres, 60 % of which is their own, in 20 ml of agent, as vials
  /// are prepared.
  static constexpr double kVolumeShare = 0.06;

  double diameter_mm = 0;  ///< 0: none

  bool are_any() const { return diameter_mm > 0; }
  bool are_valid() const { return diameter_mm == 0 || (diameter_mm >= kLeast_mm && diameter_mm <= kMost_mm); }
  /// What passes a lumen of this diameter: they, or none.
  Particles through(double lumen_mm) const { return diameter_mm < lumen_mm ? *this : Particles{}; }
  double per_ml() const;
};

/// Throws InputError, naming `particles_mm`, unless they are valid.
void check(const Particles& particles);

/// Particles behind a leaf, and what they have left of its periphery; or those that are elsewhere.
struct Embolised {
  int branch = 0;      ///< kElsewhere: beyond the tree's root, or in several
  std::string vessel;  ///< the branch in words
  double particles = 0;
  double open_share = 1;  ///< of the periphery's conductance

  static constexpr int kElsewhere = -1;
};

/// `4120 particles in left renal artery, whose periphery has 9 % of its conductance left`.
std::string in_words(const Embolised& embolised);

/// The vessels with the most particles first; the others, where there are more than `most`, as one.
std::vector<Embolised> most_first(std::vector<Embolised> embolised, std::size_t most);

/// Where injected particles went.
///
/// They go with the blood, at each bifurcation in proportion to the flows, also back towards the root where
/// an injection refluxes. The time of the way, a second or two, is passed over; so flows are their means over
/// heartbeats: what goes back in diastole for some millimetres is not lost to another branch. Behind a
/// leaf they close arterioles of their own diameter, kPerArteriole each, as they lodge in a column: a model's
/// number, of the order of the vials that are used up until the blood stands still. There are as many
/// arterioles as carry the leaf's flow at rest at the wall shear stress of arteries, 1.5 Pa (Malek et al.,
/// JAMA 282:2035, 1999).
class Embolisation {
 public:
  static constexpr double kPerArteriole = 10;

  Embolisation(const VesselTree& tree, const RestFlow& rest);

  /// The blood that goes through the start and the end of each branch, away from the root, in any unit.
  struct Flows {
    std::vector<double> start, end;
  };

  /// So many particles from a place in a branch.
  void add(double count, double diameter_mm, std::size_t branch, const Flows& flows);

  double open_share(std::size_t leaf) const { return open_share_[leaf]; }
  /// Where there is a particle or more, by the branches' numbers; elsewhere comes last. What is injected
  /// where the blood stands still stays in that branch.
  std::vector<Embolised> list() const;

 private:
  void leave_end(double count, double diameter_mm, std::size_t branch, const Flows& flows);
  void leave_start(double count, double diameter_mm, std::size_t branch, const Flows& flows);

  const VesselTree& tree_;
  std::vector<double> rest_ml_s_;
  std::vector<bool> is_outlet_;
  std::vector<double> particles_, open_share_;  ///< of each branch
  double elsewhere_ = 0;
};

}  // namespace xraycast
