#pragma once

#include "xraycast/blood_flow/blood.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <string>
#include <vector>

namespace xraycast {

/// The share of the heart's output that an artery has at rest, by its name; 0: not known, or it depends on
/// where the artery is cut.
///
/// Organs: kidneys 19 %, liver 6.5 % by its artery, spleen 3 %, stomach and oesophagus 1 %, pancreas 1 %,
/// small intestine 10 %, large 4 %, brain 12 %, heart 4 % (Williams and Leggett, Clin Phys Physiol Meas
/// 10:187, 1989; ICRP Publication 89, 2002). The brain's is divided among its four arteries, and the common
/// carotid's put to it, in proportion to the flows that Schöning et al. saw (Stroke 25:17, 1994); the heart's
/// two to one between left and right.
double rest_share(const std::string& name);

/// Which coronary system a name is of.
enum class Coronary { none, left, right };
Coronary coronary_of(const std::string& name);

/// A tree's blood at rest, of every branch, as in the healthy tree: stenoses count as what they narrow.
struct RestFlow {
  std::vector<double> ml_s;
  /// Of every branch; those beyond a coronary artery are of it.
  std::vector<Coronary> coronary;
  /// Of every branch: blood leaves the tree through its end. Not through a sac (see AneurysmSac), nor through
  /// a branch that goes on in others than sacs.
  std::vector<bool> is_outlet;
};

/// The root has the share of its name, or else Blood's velocity, but never more than the heart's output. At a
/// bifurcation arteries with a share by their names have that; the others divide what is left by the power of
/// their radii in Blood, and have at least half of what they would have by it. A sac has none.
RestFlow rest_flow(const VesselTree& tree, const Blood& blood);

/// Branches, each behind its parent.
std::vector<int> parents_first(const VesselTree& tree);

}  // namespace xraycast
