#include "xraycast/lesions/random_edits.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/geometry/tube.hpp"
#include "xraycast/lesions/placed_edits.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>

namespace xraycast {
namespace {

/// Numbers that are the same on every machine, as those of the library's distributions are not.
class Chance {
 public:
  explicit Chance(std::uint64_t seed) : random_(seed) {}
  double between(double low, double high) {
    constexpr double kUnit = 1.0 / 9007199254740992.0;  // 53 bits
    return low + (high - low) * static_cast<double>(random_() >> 11) * kUnit;
  }
  bool is_likely(double probability) { return between(0, 1) < probability; }

 private:
  std::mt19937_64 random_;
};

/// A hundredth of a millimetre is fine enough, and reads well.
double rounded(double value, double step) { return std::round(value / step) * step; }

/// A place on the tree, the longer a branch the likelier.
struct Drawn {
  std::size_t branch;
  double at_mm;
};

Drawn drawn_place(const VesselTree& tree, Chance& chance) {
  double all_mm = 0;
  for (const VesselBranch& branch : tree.branches()) all_mm += branch.arc_length_mm.back();
  double at_mm = chance.between(0, all_mm);
  for (std::size_t b = 0; b + 1 < tree.branches().size(); ++b) {
    const double length_mm = tree.branches()[b].arc_length_mm.back();
    if (at_mm < length_mm) return {b, at_mm};
    at_mm -= length_mm;
  }
  return {tree.branches().size() - 1, at_mm};
}

StenosisEdit drawn_stenosis(const VesselTree& tree, Chance& chance) {
  const Drawn place = drawn_place(tree, chance);
  const double diameter_mm = 2 * point_at(tree.branches()[place.branch], place.at_mm).radius_mm;
  StenosisEdit edit{.branch = fmt::format("{}", place.branch),
                    .at_mm = rounded(place.at_mm, 0.01),
                    .length_mm = rounded(std::clamp(chance.between(1, 4) * diameter_mm, 3.0, 40.0), 0.01),
                    .percent = rounded(chance.between(30, 90), 0.1)};
  if (chance.is_likely(0.5)) {
    const double turn = chance.between(0, 2 * std::numbers::pi), height = chance.between(-1, 1);
    const double across = std::sqrt(1 - height * height);
    edit.towards = glm::dvec3(across * std::cos(turn), across * std::sin(turn), height);
  }
  if (chance.is_likely(1.0 / 3)) edit.plaque = PlaqueKind::calcium;
  return edit;
}

AneurysmEdit drawn_aneurysm(const VesselTree& tree, Chance& chance) {
  const Drawn place = drawn_place(tree, chance);
  const VesselBranch& branch = tree.branches()[place.branch];
  const VesselPoint middle = point_at(branch, place.at_mm);
  const std::array<VesselPoint, 2> piece{middle, point_at(branch, place.at_mm + 0.5)};
  const double turn = chance.between(0, 2 * std::numbers::pi), size = chance.between(1, 2),
               neck = chance.between(0.4, 0.7);
  AneurysmEdit edit;
  edit.diameter_mm = rounded(std::max(2.0, size * 2 * middle.radius_mm), 0.01);
  edit.neck_mm = rounded(neck * edit.diameter_mm, 0.01);
  if (glm::distance(piece[0].position_mm, piece[1].position_mm) < 1e-6) return edit;  // at its end: no room
  edit.point_mm = rings_along(piece).front().at_mm(turn);
  return edit;
}

/// Whether the tree has room for edits.
bool has_room(const VesselTree& tree, const Edits& edits) {
  try {
    placed_edits(tree, edits);
    return true;
  } catch (const InputError&) {
    return false;
  }
}

}  // namespace

Edits with_random_edits(const VesselTree& tree, const Edits& edits, int count, std::uint64_t seed,
                        std::vector<std::string>& notes) {
  Chance chance(seed);
  Edits all = edits;
  int made = 0;
  constexpr double kStenoses = 0.75;
  constexpr int kTries = 60;
  for (int lesion = 0; lesion < count; ++lesion) {
    const bool is_stenosis = chance.is_likely(kStenoses);
    for (int attempt = 0; attempt < kTries; ++attempt) {
      Edits more = all;
      if (is_stenosis)
        more.stenoses.push_back(drawn_stenosis(tree, chance));
      else
        more.aneurysms.push_back(drawn_aneurysm(tree, chance));
      if (!has_room(tree, more)) continue;
      all = std::move(more);
      ++made;
      break;
    }
  }
  if (made < count)
    notes.push_back(fmt::format("`random`: room for {} of {}", made, pluralize(count, "lesion")));
  return all;
}

}  // namespace xraycast
