#include "xraycast/vessel_names/edited_names.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/branch_names.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <optional>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

/// The names in a tree's own file, which read_tree has accepted; those beside it do not count.
std::vector<std::string> names_in_tree_file(const fs::path& file) {
  const nlohmann::json tree = parse_json(read_whole_file(file), file.string());
  std::vector<std::string> names;
  for (const nlohmann::json& branch : tree["branches"])
    names.push_back(branch.contains("name") ? vessel_name(branch["name"], file.string()) : "");
  return names;
}

/// The branch of an earlier tree along which more than half of a branch lies, within that one's lumen.
std::optional<std::size_t> earlier_branch(const VesselBranch& branch, const VesselTree& earlier) {
  constexpr double kBeside_mm = 1;  // of a thin vessel's wall
  std::vector<double> along_mm(earlier.branches().size());
  for (std::size_t i = 1; i < branch.points.size(); ++i) {
    const glm::dvec3 &a = branch.points[i - 1].position_mm, &b = branch.points[i].position_mm;
    const VesselTree::Location place = earlier.nearest(0.5 * (a + b));
    if (place.distance_mm <= place.radius_mm + kBeside_mm)
      along_mm[static_cast<std::size_t>(place.branch)] += glm::distance(a, b);
  }
  const auto best = std::ranges::max_element(along_mm);
  if (2 * *best <= branch.arc_length_mm.back()) return std::nullopt;
  return static_cast<std::size_t>(best - along_mm.begin());
}

std::string quoted(const std::string& name) {
  return name.empty() ? "a name taken away" : "\"" + name + "\"";
}

}  // namespace

EditedNames with_edited_names(const VesselTree& tree, const fs::path& folder) {
  const fs::path file = folder / kNamesFile, tree_file = folder / "tree.json";
  std::error_code error;
  if (!fs::exists(file, error)) return {.tree = tree, .notes = {}};
  std::vector<std::string> names, taken, left;
  for (const VesselBranch& branch : tree.branches()) names.push_back(branch.name);
  try {
    const VesselTree earlier = read_tree(tree_file);
    const std::vector<std::string> found = names_in_tree_file(tree_file);
    std::vector<bool> is_edited, is_taken(found.size());
    for (std::size_t i = 0; i < found.size(); ++i)
      is_edited.push_back(earlier.branches()[i].name != found[i]);
    if (std::ranges::find(is_edited, true) == is_edited.end()) return {.tree = tree, .notes = {}};
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::optional<std::size_t> branch = earlier_branch(tree.branches()[i], earlier);
      if (!branch || !is_edited[*branch]) continue;
      names[i] = earlier.branches()[*branch].name;
      is_taken[*branch] = true;
    }
    for (std::size_t i = 0; i < found.size(); ++i)
      if (is_edited[i]) (is_taken[i] ? taken : left).push_back(quoted(earlier.branches()[i].name));
  } catch (const InputError& failure) {
    return {.tree = tree,
            .notes = {fmt::format("{}: edits could not be taken over: {}", file.string(), failure.what())},
            .is_all_taken = false};
  }
  std::vector<std::string> notes;
  if (!taken.empty())
    notes.push_back(fmt::format("{}: kept as edited: {}", file.string(), fmt::join(taken, ", ")));
  if (!left.empty())
    notes.push_back(
        fmt::format("{}: no branch lies where these were: {}", file.string(), fmt::join(left, ", ")));
  return {.tree = with_branch_names(tree, names), .notes = std::move(notes), .is_all_taken = left.empty()};
}

fs::path free_name_for_earlier(const fs::path& folder) {
  std::error_code error;
  fs::path file = folder / "names-earlier.json";
  for (int number = 2; fs::exists(file, error); ++number)
    file = folder / fmt::format("names-earlier-{}.json", number);
  return file;
}

}  // namespace xraycast
