#include "xraycast/vessel_names/edited_names.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/branch_names.hpp"
#include "xraycast/scan/scan.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
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

/// A piece of a centreline between two points.
struct Piece {
  glm::dvec3 middle_mm, direction;
  double radius_mm, length_mm;
};

template <typename Visit>
void for_each_piece(const VesselBranch& branch, const Visit& visit) {
  for (std::size_t i = 1; i < branch.points.size(); ++i) {
    const VesselPoint &a = branch.points[i - 1], &b = branch.points[i];
    const glm::dvec3 step_mm = b.position_mm - a.position_mm;
    visit(Piece{0.5 * (a.position_mm + b.position_mm), glm::normalize(step_mm),
                0.5 * (a.radius_mm + b.radius_mm), glm::length(step_mm)});
  }
}

glm::dvec3 direction_at(const VesselTree::Location& place, const VesselTree& tree) {
  const VesselBranch& branch = tree.branches()[static_cast<std::size_t>(place.branch)];
  const auto& along_mm = branch.arc_length_mm;
  const auto next = std::clamp(std::ranges::upper_bound(along_mm, place.arc_length_mm), along_mm.begin() + 1,
                               along_mm.end() - 1) -
                    along_mm.begin();
  return glm::normalize(branch.points[static_cast<std::size_t>(next)].position_mm -
                        branch.points[static_cast<std::size_t>(next - 1)].position_mm);
}

/// The branch of a tree whose line a piece follows: near its middle, in its direction and of its width, so
/// that what leaves a wide vessel sideways is not that vessel while it crosses its lumen.
std::optional<std::size_t> followed_branch(const Piece& piece, const VesselTree& tree) {
  constexpr double kBeside_mm = 1;      // of a thin vessel's line
  constexpr double kLeastCosine = 0.5;  // lines along voxels turn by up to 45 degrees from step to step
  constexpr double kWidest = 2;         // a lumen's radius when its wall is found anew
  const VesselTree::Location place = tree.nearest(piece.middle_mm);
  if (place.distance_mm > 0.5 * place.radius_mm + kBeside_mm) return std::nullopt;
  const double width = piece.radius_mm / place.radius_mm;
  if (width > kWidest || kWidest * width < 1) return std::nullopt;
  if (std::abs(glm::dot(piece.direction, direction_at(place, tree))) < kLeastCosine) return std::nullopt;
  return static_cast<std::size_t>(place.branch);
}

/// How a branch lies along an earlier tree.
struct Followed {
  std::size_t branch = 0;
  double mm = 0;
};

/// The branch of an earlier tree that a branch follows along more than half of its length.
std::optional<Followed> earlier_branch(const VesselBranch& branch, const VesselTree& earlier) {
  std::vector<double> along_mm(earlier.branches().size());
  for_each_piece(branch, [&](const Piece& piece) {
    if (const auto followed = followed_branch(piece, earlier)) along_mm[*followed] += piece.length_mm;
  });
  const auto best = std::ranges::max_element(along_mm);
  if (2 * *best <= branch.arc_length_mm.back()) return std::nullopt;
  return Followed{static_cast<std::size_t>(best - along_mm.begin()), *best};
}

double length_mm(const VesselTree& tree) {
  double sum_mm = 0;
  for (const VesselBranch& branch : tree.branches()) sum_mm += branch.arc_length_mm.back();
  return sum_mm;
}

/// Whether two trees are of the same vessels, of which one may show more: the shorter one follows the longer
/// one along more than half of its length.
bool are_of_same_vessels(const VesselTree& a, const VesselTree& b) {
  const bool is_a_shorter = length_mm(a) < length_mm(b);
  const VesselTree &shorter = is_a_shorter ? a : b, &longer = is_a_shorter ? b : a;
  double common_mm = 0;
  for (const VesselBranch& branch : shorter.branches())
    for_each_piece(branch, [&](const Piece& piece) {
      if (followed_branch(piece, longer)) common_mm += piece.length_mm;
    });
  return 2 * common_mm > length_mm(shorter);
}

/// Whether two grids may be parts of one scan: the voxels of one lie where those of the other do.
bool are_of_one_scan(const VolumeGeometry& a, const VolumeGeometry& b) {
  constexpr double kRounding = 0.01;  // of a voxel: numbers of a text header
  const glm::dvec3 steps(b.size - Index3(1)), first = a.to_index(b.origin_mm),
                                              last = a.to_index(b.to_world_mm(steps));
  const glm::dvec3 off = glm::max(glm::abs(first - glm::round(first)), glm::abs(last - first - steps));
  return std::max({off.x, off.y, off.z}) < kRounding;
}

/// Whether the mask of a folder is of another scan than a grid; not where there is none that can be read.
bool is_of_another_scan(const fs::path& folder, const VolumeGeometry& grid) {
  std::error_code error;
  const fs::path mask = folder / "mask.nrrd";
  if (!fs::exists(mask, error)) return false;
  try {
    Progress unheard;
    return !are_of_one_scan(open_scan(mask, {}, unheard).source->geometry(), grid);
  } catch (const InputError&) {
    return false;
  }
}

std::string quoted(const std::string& name) {
  return name.empty() ? "a name taken away" : "\"" + name + "\"";
}

/// The edits of a folder's names.json.
struct Edits {
  VesselTree earlier;           ///< with the names of names.json
  std::vector<bool> is_edited;  ///< of each of its branches
  bool is_empty() const { return std::ranges::find(is_edited, true) == is_edited.end(); }
};

Edits edits_of(const fs::path& folder) {
  const fs::path tree_file = folder / "tree.json";
  Edits edits{read_tree(tree_file), {}};
  const std::vector<std::string> found = names_in_tree_file(tree_file);
  for (std::size_t i = 0; i < found.size(); ++i)
    edits.is_edited.push_back(edits.earlier.branches()[i].name != found[i]);
  return edits;
}

EditedNames with_edits(const VesselTree& tree, const Edits& edits, const std::string& file) {
  const std::vector<VesselBranch>& earlier = edits.earlier.branches();
  std::vector<std::string> names, taken, in_part, left;
  std::vector<double> taken_mm(earlier.size());
  for (const VesselBranch& branch : tree.branches()) {
    names.push_back(branch.name);
    const auto followed = earlier_branch(branch, edits.earlier);
    if (!followed || !edits.is_edited[followed->branch]) continue;
    names.back() = earlier[followed->branch].name;
    taken_mm[followed->branch] += followed->mm;
  }
  for (std::size_t i = 0; i < earlier.size(); ++i) {
    if (!edits.is_edited[i]) continue;
    const bool is_whole = 2 * taken_mm[i] >= earlier[i].arc_length_mm.back();
    (taken_mm[i] == 0 ? left : is_whole ? taken : in_part).push_back(quoted(earlier[i].name));
  }
  std::vector<std::string> notes;
  const auto note = [&](const char* what, const std::vector<std::string>& of) {
    if (!of.empty()) notes.push_back(fmt::format("{}: {}: {}", file, what, fmt::join(of, ", ")));
  };
  note("kept as edited", taken);
  note("kept, but less than half of these is there", in_part);
  note("no branch lies where these were", left);
  return {.tree = with_branch_names(tree, names),
          .notes = std::move(notes),
          .is_all_taken = left.empty() && in_part.empty()};
}

}  // namespace

fs::path free_name_for_earlier(const fs::path& folder) {
  std::error_code error;
  fs::path file = folder / "names-earlier.json";
  for (int number = 2; fs::exists(file, error); ++number)
    file = folder / fmt::format("names-earlier-{}.json", number);
  return file;
}

void check_names(const fs::path& folder) {
  std::error_code error;
  if (fs::exists(folder / kNamesFile, error)) read_whole_file(folder / kNamesFile);
}

EditedNames with_edited_names(const VesselTree& tree, const fs::path& folder, const VolumeGeometry* grid) {
  const fs::path file = folder / kNamesFile;
  std::error_code error;
  if (!fs::exists(file, error)) return {.tree = tree, .notes = {}};
  const auto none_taken = [&](const std::string& why) {
    return EditedNames{
        .tree = tree, .notes = {fmt::format("{}: {}", file.string(), why)}, .is_all_taken = false};
  };
  try {
    const Edits edits = edits_of(folder);
    if (edits.is_empty()) return {.tree = tree, .notes = {}};
    if ((grid && is_of_another_scan(folder, *grid)) || !are_of_same_vessels(tree, edits.earlier))
      return none_taken("edited names were not taken over: they are those of other vessels");
    return with_edits(tree, edits, file.string());
  } catch (const Cancelled&) {
    throw;
  } catch (const Error& failure) {
    return none_taken(fmt::format("edits could not be taken over: {}", failure.what()));
  }
}

fs::path keep_names(const fs::path& folder) {
  const fs::path file = folder / kNamesFile;
  fs::path earlier = free_name_for_earlier(folder);
  try {
    write_whole_file(earlier, read_whole_file(file));
  } catch (const InputError&) {
    std::error_code error;
    fs::rename(file, earlier, error);
    if (error)
      throw InputError("{}: cannot be kept as {}: {}; move it", file.string(), earlier.string(),
                       error.message());
  }
  return earlier;
}

}  // namespace xraycast
