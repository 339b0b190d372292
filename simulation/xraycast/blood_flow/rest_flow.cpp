#include "xraycast/blood_flow/rest_flow.hpp"

#include "xraycast/blood_flow/vessel_impedance.hpp"
#include "xraycast/catheter/aneurysm_sac.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <numbers>
#include <string_view>

namespace xraycast {
namespace {

struct NamedShare {
  std::string_view name;
  double share;
};

// A whole name: others have a left main artery or vein too.
constexpr std::string_view kLeftMain = "left main";
constexpr double kLeftCoronary = 0.027;

// Of several that fit, the first one counts. Branches of these, such as a right hepatic artery, divide what
// their parent has.
constexpr std::array kShares{
    NamedShare{"renal artery", 0.095},
    NamedShare{"coeliac trunk", 0.115},  // liver, spleen, stomach and oesophagus, pancreas
    NamedShare{"celiac trunk", 0.115},
    NamedShare{"right hepatic artery", 0},
    NamedShare{"left hepatic artery", 0},
    NamedShare{"middle hepatic artery", 0},
    NamedShare{"hepatic artery", 0.07},   // with half of the stomach
    NamedShare{"splenic artery", 0.045},  // with the other half, and the pancreas
    NamedShare{"superior mesenteric artery", 0.12},
    NamedShare{"inferior mesenteric artery", 0.02},
    NamedShare{"internal carotid artery", 0.045},
    NamedShare{"external carotid artery", 0.027},
    NamedShare{"common carotid artery", 0.072},
    NamedShare{"vertebral artery", 0.015},
    NamedShare{"left coronary artery", kLeftCoronary},
    NamedShare{"left main coronary artery", kLeftCoronary},
    NamedShare{"left main stem", kLeftCoronary},
    NamedShare{"right coronary artery", 0.013},
};

constexpr std::array<std::string_view, 2> kRightCoronaries{"right coronary", "RCA"};
constexpr std::array<std::string_view, 8> kLeftCoronaries{"coronary",
                                                          "left main stem",
                                                          "anterior descending",
                                                          "circumflex artery",
                                                          "circumflex branch",
                                                          "obtuse marginal",
                                                          "LAD",
                                                          "LCX"};
// Whole names: there are circumflex arteries of the arm and the thigh.
constexpr std::array<std::string_view, 3> kLeftCoronaryNames{kLeftMain, "circumflex", "left circumflex"};

/// Whether words stand in a name as whole words: a suprarenal artery is no renal artery.
bool contains(std::string_view name, std::string_view words) {
  const auto is_letter = [&](std::size_t at) {
    return at < name.size() && std::isalpha(static_cast<unsigned char>(name[at])) != 0;
  };
  for (std::size_t at = 0; (at = name.find(words, at)) != std::string_view::npos; ++at)
    if (!(at > 0 && is_letter(at - 1)) && !is_letter(at + words.size())) return true;
  return false;
}

/// A child starts at its parent's end; a little further on it has its own width.
double own_radius_mm(const VesselBranch& branch) {
  return healthy_radii_mm(branch)[branch.points.size() / 2];
}

/// See RestFlow.
std::vector<bool> outlets_of(const VesselTree& tree) {
  const auto is_sac = [&](int branch) { return sac_of(tree, branch).has_value(); };
  std::vector<bool> is_outlet;
  for (std::size_t b = 0; b < tree.branches().size(); ++b) {
    const std::vector<int>& children = tree.branches()[b].children;
    is_outlet.push_back(!is_sac(static_cast<int>(b)) &&
                        std::all_of(children.begin(), children.end(), is_sac));
  }
  return is_outlet;
}

double root_flow_ml_s(const VesselTree& tree, const Blood& blood) {
  const VesselBranch& root = tree.branches()[static_cast<std::size_t>(tree.root())];
  constexpr double kMl_per_mm3 = 1e-3;
  const double share = rest_share(root.name);
  const double radius_mm = root.points.front().radius_mm, output_ml_s = heart_output_ml_s(blood);
  const double ml_s = share > 0 ? share * output_ml_s
                                : kMl_per_mm3 * std::numbers::pi * radius_mm * radius_mm *
                                      blood.root_velocity_mm_s * output_ml_s / kHeartOutput_ml_s;
  return std::min(ml_s, output_ml_s);
}

}  // namespace

double heart_output_ml_s(const Blood& blood) {
  return blood.heart ? blood.heart->mean_ml_s() : kHeartOutput_ml_s;
}

double rest_share(const std::string& name) {
  for (const NamedShare& known : kShares)
    if (contains(name, known.name)) return known.share;
  if (name == kLeftMain) return kLeftCoronary;
  return 0;
}

Coronary coronary_of(const std::string& name) {
  for (const std::string_view part : kRightCoronaries)
    if (contains(name, part)) return Coronary::right;
  for (const std::string_view part : kLeftCoronaries)
    if (contains(name, part)) return Coronary::left;
  if (std::find(kLeftCoronaryNames.begin(), kLeftCoronaryNames.end(), name) != kLeftCoronaryNames.end())
    return Coronary::left;
  return Coronary::none;
}

std::vector<int> parents_first(const VesselTree& tree) {
  std::vector<int> order{tree.root()};
  for (std::size_t i = 0; i < order.size(); ++i)
    for (const int child : tree.branches()[static_cast<std::size_t>(order[i])].children)
      order.push_back(child);
  return order;
}

RestFlow rest_flow(const VesselTree& tree, const Blood& blood) {
  const auto& branches = tree.branches();
  const double output_ml_s = heart_output_ml_s(blood);
  RestFlow rest{std::vector<double>(branches.size()), std::vector<Coronary>(branches.size()),
                outlets_of(tree)};
  const auto root = static_cast<std::size_t>(tree.root());
  rest.ml_s[root] = root_flow_ml_s(tree, blood);
  rest.coronary[root] = coronary_of(branches[root].name);
  for (const int parent : parents_first(tree)) {
    const VesselBranch& divides = branches[static_cast<std::size_t>(parent)];
    if (rest.is_outlet[static_cast<std::size_t>(parent)]) continue;
    const double flow_ml_s = rest.ml_s[static_cast<std::size_t>(parent)];
    // A vessel that goes on under its name is none that leaves.
    const auto share_of = [&](int child) {
      const std::string& name = branches[static_cast<std::size_t>(child)].name;
      return name == divides.name || sac_of(tree, child) ? 0 : rest_share(name);
    };
    const auto width_of = [&](int child) {
      if (sac_of(tree, child)) return 0.0;
      return std::pow(own_radius_mm(branches[static_cast<std::size_t>(child)]), blood.split_exponent);
    };
    double named_ml_s = 0, widths = 0, all_widths = 0;
    for (const int child : divides.children) {
      named_ml_s += share_of(child) * output_ml_s;
      widths += share_of(child) > 0 ? 0 : width_of(child);
      all_widths += width_of(child);
    }
    constexpr double kLeastOfOthers = 0.5;
    const double most_ml_s = flow_ml_s * (1 - kLeastOfOthers * widths / all_widths);
    // Where all have names they share what there is.
    const double scale =
        named_ml_s == 0 ? 0 : (widths == 0 ? flow_ml_s : std::min(named_ml_s, most_ml_s)) / named_ml_s;
    for (const int child : divides.children) {
      const auto c = static_cast<std::size_t>(child);
      const double share = share_of(child);
      if (share > 0)
        rest.ml_s[c] = scale * share * output_ml_s;
      else if (width_of(child) > 0)
        rest.ml_s[c] = (flow_ml_s - scale * named_ml_s) * width_of(child) / widths;
      const Coronary own = coronary_of(branches[c].name);
      rest.coronary[c] = own == Coronary::none ? rest.coronary[static_cast<std::size_t>(parent)] : own;
    }
  }
  return rest;
}

}  // namespace xraycast
