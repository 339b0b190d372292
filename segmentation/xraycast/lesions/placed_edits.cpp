#include "xraycast/lesions/placed_edits.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/geometry/branch_names.hpp"
#include "xraycast/lesions/tube_places.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <string_view>

namespace xraycast {
namespace {

const VesselBranch& branch_of(const VesselTree& tree, int branch) {
  return tree.branches()[static_cast<std::size_t>(branch)];
}

double length_of(const VesselTree& tree, int branch) { return branch_of(tree, branch).arc_length_mm.back(); }

/// "branch 3 (left renal artery)"
std::string branch_in_words(const VesselTree& tree, int branch) {
  const std::string& name = branch_of(tree, branch).name;
  return name.empty() ? fmt::format("branch {}", branch) : fmt::format("branch {} ({})", branch, name);
}

// ---- stenoses -------------------------------------------------------------------------------------------

struct PlaceOnBranch {
  int branch;
  double at_mm;
};

/// A vessel of several branches counts from the start of its first one: each follows its parent.
PlaceOnBranch place_on_vessel(const VesselTree& tree, const std::vector<int>& vessel, double at_mm) {
  const auto is_of_vessel = [&](int branch) { return std::ranges::find(vessel, branch) != vessel.end(); };
  int branch = vessel.front();
  while (is_of_vessel(branch_of(tree, branch).parent)) branch = branch_of(tree, branch).parent;
  while (at_mm > length_of(tree, branch)) {
    const auto& children = branch_of(tree, branch).children;
    const auto next = std::ranges::find_if(children, is_of_vessel);
    if (next == children.end()) break;
    at_mm -= length_of(tree, branch);
    branch = *next;
  }
  return {branch, at_mm};
}

glm::dvec3 direction_at(const VesselBranch& branch, double at_mm) {
  const double step_mm = std::min(0.5, 0.1 * branch.arc_length_mm.back());
  return glm::normalize(point_at(branch, at_mm + step_mm).position_mm -
                        point_at(branch, at_mm - step_mm).position_mm);
}

glm::dvec3 across(const glm::dvec3& v, const glm::dvec3& along) { return v - glm::dot(v, along) * along; }

/// From the chord to the outer wall of a bend: plaque lies at its inner wall, where blood is slow (Asakura
/// and Karino, Flow patterns and spatial distribution of atherosclerotic lesions in human coronary arteries,
/// 1990). Where a vessel is straight, to the patient's left or front.
glm::dvec3 outer_side(const VesselBranch& branch, double at_mm, double length_mm, const glm::dvec3& along) {
  const glm::dvec3 chord_mm = 0.5 * (point_at(branch, at_mm - 0.5 * length_mm).position_mm +
                                     point_at(branch, at_mm + 0.5 * length_mm).position_mm);
  const glm::dvec3 bow_mm = across(point_at(branch, at_mm).position_mm - chord_mm, along);
  constexpr double kBend = 0.01;  // of the length: less is a straight vessel's rounding
  if (glm::length(bow_mm) > kBend * length_mm) return glm::normalize(bow_mm);
  const glm::dvec3 left(1, 0, 0), front(0, -1, 0);
  return glm::normalize(across(std::abs(glm::dot(left, along)) < 0.9 ? left : front, along));
}

glm::dvec3 side_of_throat(const StenosisEdit& edit, const VesselBranch& branch, double at_mm,
                          const std::string& field) {
  if (!edit.towards) return glm::dvec3(0);
  const glm::dvec3 along = direction_at(branch, at_mm);
  if (glm::length(*edit.towards) == 0) return outer_side(branch, at_mm, edit.length_mm, along);
  const glm::dvec3 side = across(glm::normalize(*edit.towards), along);
  constexpr double kLeastAcross = 0.2;
  if (glm::length(side) < kLeastAcross)
    throw InputError("{}: the vessel runs to that side; give a side across it, or eccentric alone", field);
  return glm::normalize(side);
}

PlacedStenosis placed(const VesselTree& tree, const TubePlaces& lumens, const StenosisEdit& edit) {
  const std::string field = fmt::format("`stenosis` {},{:g},{:g},{:g}{}", edit.branch, edit.at_mm,
                                        edit.length_mm, edit.percent, edit.is_of_area ? "a" : "");
  const PlaceOnBranch place = place_on_vessel(tree, branches_meant(tree, edit.branch, field), edit.at_mm);
  const VesselBranch& branch = branch_of(tree, place.branch);
  const double share = edit.percent / 100, length_mm = branch.arc_length_mm.back();
  PlacedStenosis stenosis{.branch = place.branch,
                          .at_mm = place.at_mm,
                          .length_mm = edit.length_mm,
                          .lost = edit.is_of_area ? 1 - std::sqrt(1 - share) : share,
                          .towards = glm::dvec3(0),
                          .plaque = edit.plaque};
  if (stenosis.first_mm() < 0 || stenosis.last_mm() > length_mm)
    throw InputError(
        "{}: reaches from {:.1f} to {:.1f} mm of {}, which is {:.1f} mm long; move or shorten it", field,
        stenosis.first_mm(), stenosis.last_mm(), branch_in_words(tree, place.branch), length_mm);
  const TubePlace deepest = lumens.deepest(point_at(branch, place.at_mm).position_mm);
  if (deepest.branch != place.branch && deepest.out_mm < -1.01 * point_at(branch, place.at_mm).radius_mm)
    throw InputError("{}: there {} lies in the lumen of {}; move it away from its end", field,
                     branch_in_words(tree, place.branch), branch_in_words(tree, deepest.branch));
  stenosis.towards = side_of_throat(edit, branch, place.at_mm, field);
  return stenosis;
}

// ---- aneurysms ------------------------------------------------------------------------------------------

std::string words_of(const AneurysmEdit& edit) {
  return fmt::format("`aneurysm` {:g},{:g},{:g},{:g},{:g}", edit.point_mm.x, edit.point_mm.y, edit.point_mm.z,
                     edit.diameter_mm, edit.neck_mm);
}

/// Throws where the ball would open into a vessel other than those that meet where it sits.
void check_room(const VesselTree& tree, const PlacedSac& sac, const glm::dvec3& centre_mm,
                const std::vector<bool>& is_removed, const std::string& field) {
  const VesselBranch& host = branch_of(tree, sac.branch);
  const double reach_mm = host.points.front().radius_mm + sac.neck_mm;
  std::vector<bool> counts(tree.branches().size(), true);
  for (std::size_t b = 0; b < counts.size(); ++b) {
    const VesselBranch& branch = tree.branches()[b];
    const bool meets_start = sac.at_mm < reach_mm &&
                             (static_cast<int>(b) == host.parent || branch.parent == host.parent),
               meets_end = sac.at_mm > host.arc_length_mm.back() - reach_mm && branch.parent == sac.branch;
    counts[b] = static_cast<int>(b) != sac.branch && !meets_start && !meets_end && !is_removed[b];
  }
  if (std::ranges::find(counts, true) == counts.end()) return;
  const TubePlace near = TubePlaces(tree, counts).deepest(centre_mm);
  constexpr double kApart_mm = 0.5;
  if (near.out_mm < 0.5 * sac.diameter_mm + kApart_mm)
    throw InputError("{}: would touch {}; make it smaller or move it", field,
                     branch_in_words(tree, near.branch));
}

PlacedSac placed(const VesselTree& tree, const TubePlaces& lumens, const AneurysmEdit& edit,
                 const std::vector<bool>& is_removed) {
  const std::string field = words_of(edit);
  const TubePlace place = lumens.deepest(edit.point_mm);
  const VesselBranch& host = branch_of(tree, place.branch);
  constexpr double kFar_mm = 5;
  if (place.out_mm > kFar_mm)
    throw InputError(
        "{}: the point lies {:.1f} mm from the nearest wall, that of {}; give one within {:g} mm", field,
        place.out_mm, branch_in_words(tree, place.branch), kFar_mm);
  const glm::dvec3 from_axis_mm = edit.point_mm - place.centre_mm;
  if (glm::length(from_axis_mm) < 0.2 * place.radius_mm)
    throw InputError("{}: the point lies on the axis of {}; give one on its wall", field,
                     branch_in_words(tree, place.branch));
  const PlacedSac sac{.branch = place.branch,
                      .at_mm = place.arc_length_mm(tree),
                      .outwards = glm::normalize(from_axis_mm),
                      .diameter_mm = edit.diameter_mm,
                      .neck_mm = edit.neck_mm};
  if (sac.neck_mm > host.arc_length_mm.back())
    throw InputError("{}: its neck is wider than {} is long, {:.1f} mm", field,
                     branch_in_words(tree, place.branch), host.arc_length_mm.back());
  // A ball that reaches beyond the axis would hold the vessel, not sit on it.
  const double depth_mm = 0.5 * sac.diameter_mm - sac.height_mm();
  if (depth_mm > place.radius_mm)
    throw InputError(
        "{}: its ball would reach {:.1f} mm into {}, beyond its axis at {:.1f} mm; make the neck narrower",
        field, depth_mm, branch_in_words(tree, place.branch), place.radius_mm);
  check_room(tree, sac, place.centre_mm + (place.radius_mm + sac.height_mm()) * sac.outwards, is_removed,
             field);
  return sac;
}

// ---- removal, scales, overlaps --------------------------------------------------------------------------

void remove_with_children(const VesselTree& tree, int branch, std::vector<bool>& is_removed) {
  is_removed[static_cast<std::size_t>(branch)] = true;
  for (const int child : branch_of(tree, branch).children) remove_with_children(tree, child, is_removed);
}

std::vector<bool> removed_branches(const VesselTree& tree, const std::vector<std::string>& removed) {
  std::vector<bool> is_removed(tree.branches().size());
  for (const std::string& words : removed) {
    const std::string field = "`remove` " + words;
    for (const int branch : branches_meant(tree, words, field)) {
      if (branch == tree.root())
        throw InputError("{}: is the root, from which the tree begins; remove its branches instead", field);
      remove_with_children(tree, branch, is_removed);
    }
  }
  return is_removed;
}

PlacedScales placed_scales(const VesselTree& tree, const std::vector<ScaleEdit>& edits) {
  PlacedScales scales{.radii = std::vector<double>(tree.branches().size(), 1)};
  for (const ScaleEdit& edit : edits) {
    if (edit.what == ScaleEdit::kSize) {
      scales.size *= edit.factor;
    } else if (edit.what == ScaleEdit::kRadii) {
      for (double& radius : scales.radii) radius *= edit.factor;
    } else {
      for (const int branch :
           branches_meant(tree, edit.what, fmt::format("`scale` {},{:g}", edit.what, edit.factor)))
        scales.radii[static_cast<std::size_t>(branch)] *= edit.factor;
    }
  }
  return scales;
}

/// A stretch of a branch that a lesion takes.
struct Stretch {
  int branch;
  double first_mm, last_mm;
  std::string words;
};

void check_apart(const VesselTree& tree, const PlacedEdits& placed) {
  std::vector<Stretch> stretches;
  for (const PlacedStenosis& s : placed.stenoses)
    stretches.push_back({s.branch, s.first_mm(), s.last_mm(), "the stenosis"});
  for (const PlacedSac& s : placed.sacs)
    stretches.push_back({s.branch, s.at_mm - 0.5 * s.neck_mm, s.at_mm + 0.5 * s.neck_mm, "the aneurysm"});
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    const Stretch& a = stretches[i];
    if (placed.is_removed[static_cast<std::size_t>(a.branch)])
      throw InputError("{} at {:.1f} mm of {} lies on a branch that `remove` takes away", a.words,
                       0.5 * (a.first_mm + a.last_mm), branch_in_words(tree, a.branch));
    for (std::size_t j = 0; j < i; ++j)
      if (const Stretch& b = stretches[j];
          a.branch == b.branch && a.first_mm < b.last_mm && b.first_mm < a.last_mm)
        throw InputError("{} and {} at {:.1f} and {:.1f} mm of {} overlap; move one of them", b.words,
                         a.words, 0.5 * (b.first_mm + b.last_mm), 0.5 * (a.first_mm + a.last_mm),
                         branch_in_words(tree, a.branch));
  }
  const auto ball_mm = [&](const PlacedSac& s) {
    const VesselPoint at = point_at(branch_of(tree, s.branch), s.at_mm);
    return at.position_mm + (at.radius_mm + s.height_mm()) * s.outwards;
  };
  for (std::size_t i = 0; i < placed.sacs.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (const PlacedSac& a = placed.sacs[i], &b = placed.sacs[j];
          glm::distance(ball_mm(a), ball_mm(b)) < 0.5 * (a.diameter_mm + b.diameter_mm))
        throw InputError("the aneurysms of {:g} and {:g} mm overlap; move one of them", b.diameter_mm,
                         a.diameter_mm);
}

}  // namespace

double PlacedSac::height_mm() const { return 0.5 * std::sqrt(diameter_mm * diameter_mm - neck_mm * neck_mm); }

bool PlacedEdits::removes_any() const { return std::ranges::find(is_removed, true) != is_removed.end(); }

std::vector<int> branches_meant(const VesselTree& tree, const std::string& words, const std::string& field) {
  const bool is_number = !words.empty() && words.size() < 10 &&
                         std::ranges::all_of(words, [](char c) { return c >= '0' && c <= '9'; });
  if (!is_number) return branches_named(tree, words, field);
  const int branch = std::stoi(words);
  if (branch >= std::ssize(tree.branches()))
    throw InputError("{}: there is no branch {}; the tree has branches 0 to {}", field, branch,
                     tree.branches().size() - 1);
  return {branch};
}

PlacedEdits placed_edits(const VesselTree& tree, const Edits& edits) {
  const TubePlaces lumens(tree);
  PlacedEdits all;
  all.is_removed = removed_branches(tree, edits.removed);
  all.scales = placed_scales(tree, edits.scales);
  for (const StenosisEdit& edit : edits.stenoses) all.stenoses.push_back(placed(tree, lumens, edit));
  for (const AneurysmEdit& edit : edits.aneurysms)
    all.sacs.push_back(placed(tree, lumens, edit, all.is_removed));
  check_apart(tree, all);
  return all;
}

}  // namespace xraycast
