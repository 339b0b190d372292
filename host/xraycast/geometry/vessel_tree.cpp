#include "xraycast/geometry/vessel_tree.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/body_bounds.hpp"
#include "xraycast/geometry/branch_names.hpp"
#include "xraycast/geometry/vtp.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <string_view>
#include <tuple>
#include <unordered_map>
#include <utility>

namespace xraycast {
namespace {

// Far below any voxel, far above the rounding of a float near 1000 mm.
constexpr double kCoincident_mm = 1e-3;
constexpr const char* kRadius = "MaximumInscribedSphereRadius";

// ---- the tree's invariants ------------------------------------------------------------------------------

bool is_finite(const glm::dvec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

/// Fills in `children` and returns the root.
int link(std::vector<VesselBranch>& branches, const std::string& name) {
  if (branches.empty()) throw InputError("{}: the vessel tree has no branches", name);
  const int size = static_cast<int>(branches.size());
  int root = -1;
  for (VesselBranch& branch : branches) branch.children.clear();
  for (int i = 0; i < size; ++i) {
    const int parent = branches[i].parent;
    if (parent < -1 || parent >= size)
      throw InputError("{}: branch {}: its parent {} does not exist", name, i, parent);
    if (parent >= 0) {
      branches[parent].children.push_back(i);
    } else if (root < 0) {
      root = i;
    } else {
      throw InputError("{}: branches {} and {} both have no parent; a tree must have one root", name, root,
                       i);
    }
  }
  if (root < 0) throw InputError("{}: no branch is the root: the parents form a cycle", name);

  std::vector<int> waiting = {root};
  std::vector<bool> reached(branches.size(), false);
  while (!waiting.empty()) {
    const int i = waiting.back();
    waiting.pop_back();
    reached[i] = true;
    waiting.insert(waiting.end(), branches[i].children.begin(), branches[i].children.end());
  }
  if (const auto lost = std::find(reached.begin(), reached.end(), false); lost != reached.end())
    throw InputError("{}: branch {}: its parents form a cycle", name, lost - reached.begin());
  return root;
}

/// Checks the points of a branch and fills in its arc lengths.
void measure(VesselBranch& branch, std::size_t index, const std::string& name) {
  if (branch.points.size() < 2)
    throw InputError("{}: branch {}: has {}, but at least two are needed", name, index,
                     pluralize(branch.points.size(), "point"));
  branch.arc_length_mm.assign(1, 0.0);
  for (std::size_t k = 0; k < branch.points.size(); ++k) {
    const VesselPoint& point = branch.points[k];
    if (!is_finite(point.position_mm) || !std::isfinite(point.radius_mm))
      throw InputError("{}: branch {}: point {} is not finite", name, index, k);
    if (point.radius_mm <= 0)
      throw InputError("{}: branch {}: point {}: the radius {} mm is not above zero", name, index, k,
                       point.radius_mm);
    if (point.radius_mm > kLargestRadius_mm)
      throw InputError("{}: branch {}: point {}: the radius {:g} mm is more than {:g} (lengths are in mm)",
                       name, index, k, point.radius_mm, kLargestRadius_mm);
    const glm::dvec3 away_mm = glm::abs(point.position_mm);
    if (const double farthest_mm = std::max({away_mm.x, away_mm.y, away_mm.z}); farthest_mm > kFarthest_mm)
      throw InputError(
          "{}: branch {}: point {} lies {:g} mm from the origin, more than {:g} (lengths are in mm)", name,
          index, k, farthest_mm, kFarthest_mm);
    if (k == 0) continue;
    const double before = branch.arc_length_mm.back();
    const double length = before + glm::distance(branch.points[k - 1].position_mm, point.position_mm);
    if (length <= before)
      throw InputError("{}: branch {}: point {} coincides with the one before it", name, index, k);
    branch.arc_length_mm.push_back(length);
  }
}

std::vector<SegmentIndex::Segment> segments_of(const std::vector<VesselBranch>& branches) {
  std::vector<SegmentIndex::Segment> segments;
  for (int i = 0; i < static_cast<int>(branches.size()); ++i) {
    const auto& points = branches[i].points;
    for (int k = 0; k + 1 < static_cast<int>(points.size()); ++k)
      segments.push_back({points[k].position_mm, points[k + 1].position_mm, points[k].radius_mm,
                          points[k + 1].radius_mm, i, k});
  }
  return segments;
}

/// Turns valid input into a valid tree's branches and its root; throws for the rest.
int complete(std::vector<VesselBranch>& branches, const std::string& name) {
  const int root = link(branches, name);
  for (std::size_t i = 0; i < branches.size(); ++i) measure(branches[i], i, name);
  for (std::size_t i = 0; i < branches.size(); ++i) {
    if (branches[i].parent < 0) continue;
    const double gap_mm = glm::distance(branches[i].points.front().position_mm,
                                        branches[branches[i].parent].points.back().position_mm);
    if (!(gap_mm <= kCoincident_mm))
      throw InputError("{}: branch {}: starts {} mm from the end of its parent {}", name, i, gap_mm,
                       branches[i].parent);
  }
  return root;
}

// ---- VTP ------------------------------------------------------------------------------------------------

void write_lines(const VesselTree& tree, const std::filesystem::path& path) {
  const auto& branches = tree.branches();
  PolyData data;
  PolyData::Array radius{kRadius, VtkType::kFloat64, 1, {}};
  for (const VesselBranch& branch : branches) {
    std::vector<std::uint32_t> line;
    for (const VesselPoint& point : branch.points) {
      line.push_back(static_cast<std::uint32_t>(data.points_mm.size()));
      data.points_mm.push_back(point.position_mm);
      radius.values.push_back(point.radius_mm);
    }
    data.lines.add(line);
  }
  data.point_arrays.push_back(std::move(radius));

  // Parents before children, in the order of a walk that finishes one leaf before it goes to the next.
  std::vector<double> groups(branches.size()), leaves(branches.size()), depths(branches.size()),
      parents(branches.size());
  int leaf = 0;
  std::vector<int> waiting = {tree.root()};
  while (!waiting.empty()) {
    const int i = waiting.back();
    waiting.pop_back();
    const VesselBranch& branch = branches[i];
    groups[i] = i;
    leaves[i] = leaf;
    parents[i] = branch.parent;
    depths[i] = branch.parent < 0 ? 0 : depths[branch.parent] + 1;
    if (branch.children.empty()) ++leaf;
    waiting.insert(waiting.end(), branch.children.rbegin(), branch.children.rend());
  }
  // VMTK assumes vtkIntArray without checking.
  data.cell_arrays = {{"GroupIds", VtkType::kInt32, 1, std::move(groups)},
                      {"CenterlineIds", VtkType::kInt32, 1, std::move(leaves)},
                      {"TractIds", VtkType::kInt32, 1, std::move(depths)},
                      {"Blanking", VtkType::kInt32, 1, std::vector<double>(branches.size(), 0.0)},
                      {"ParentIds", VtkType::kInt32, 1, std::move(parents)}};
  write_vtp(data, path);
}

/// The line that ends exactly where each one starts.
void find_parents(std::vector<VesselBranch>& branches, const std::string& name) {
  const auto key = [](const VesselPoint& point) {
    return std::tuple(point.position_mm.x, point.position_mm.y, point.position_mm.z);
  };
  std::map<std::tuple<double, double, double>, int> ends;
  for (int i = 0; i < static_cast<int>(branches.size()); ++i) {
    if (branches[i].points.empty()) throw InputError("{}: Lines: line {} has no points", name, i);
    if (const auto [other, added] = ends.emplace(key(branches[i].points.back()), i); !added)
      throw InputError(
          "{}: Lines: lines {} and {} end at the same point; in a tree each branch has its own end", name,
          other->second, i);
  }
  for (VesselBranch& branch : branches)
    if (const auto parent = ends.find(key(branch.points.front())); parent != ends.end())
      branch.parent = parent->second;
}

std::vector<VesselBranch> read_lines(const std::filesystem::path& path) {
  const std::string name = path.string();
  const PolyData data = read_vtp(path);
  const PolyData::Array* radius = find_array(data.point_arrays, kRadius);
  if (radius == nullptr || radius->components != 1)
    throw InputError("{}: {}: a tree needs this point array, one number per point", name, kRadius);
  std::vector<VesselBranch> branches(data.lines.size());
  for (std::size_t i = 0; i < branches.size(); ++i)
    for (const std::uint32_t point : data.lines[i])
      branches[i].points.push_back({data.points_mm[point], radius->values[point]});

  if (const PolyData::Array* parents = find_array(data.cell_arrays, "ParentIds")) {
    if (parents->components != 1) throw InputError("{}: ParentIds: one number per line is needed", name);
    for (std::size_t i = 0; i < branches.size(); ++i) {
      const double parent = parents->values[data.verts.size() + i];
      if (!(parent >= -1 && parent < static_cast<double>(branches.size())) || parent != std::floor(parent))
        throw InputError("{}: ParentIds: branch {}: its parent {} does not exist", name, i, parent);
      branches[i].parent = static_cast<int>(parent);
    }
  } else {
    find_parents(branches, name);
  }
  return branches;
}

// ---- JSON -----------------------------------------------------------------------------------------------

void write_json(const VesselTree& tree, const std::filesystem::path& path) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const VesselBranch& branch : tree.branches()) {
    nlohmann::ordered_json points = nlohmann::ordered_json::array();
    for (const VesselPoint& point : branch.points)
      points.push_back({point.position_mm.x, point.position_mm.y, point.position_mm.z, point.radius_mm});
    nlohmann::ordered_json entry{
        {"id", list.size()}, {"parent", branch.parent}, {"children", branch.children}};
    if (!branch.name.empty()) entry["name"] = branch.name;
    entry["points"] = std::move(points);
    list.push_back(std::move(entry));
  }
  write_whole_file(path, nlohmann::ordered_json{{"branches", std::move(list)}}.dump() + "\n");
}

/// The member of an object of the file; throws when it is missing.
const nlohmann::json& member(const nlohmann::json& object, const char* key, const std::string& name) {
  if (!object.is_object() || !object.contains(key)) throw InputError("{}: \"{}\" is missing", name, key);
  return object[key];
}

std::int64_t integer(const nlohmann::json& object, const char* key, const std::string& name) {
  const auto number = whole_number(member(object, key, name));
  if (!number) throw InputError("{}: \"{}\" is not a 64-bit integer", name, key);
  return *number;
}

std::vector<VesselBranch> read_json(const std::filesystem::path& path) {
  const std::string name = path.string();
  const nlohmann::json document = parse_json(read_whole_file(path), name);
  if (document.is_discarded()) throw InputError("{}: not valid JSON; write it again", name);

  const nlohmann::json& list = member(document, "branches", name);
  if (!list.is_array()) throw InputError("{}: \"branches\" is not a list", name);
  std::unordered_map<std::int64_t, int> index_of_id;
  for (const nlohmann::json& entry : list) {
    const std::int64_t id = integer(entry, "id", name);
    if (id < 0) throw InputError("{}: \"id\" {} is below zero", name, id);
    if (!index_of_id.emplace(id, static_cast<int>(index_of_id.size())).second)
      throw InputError("{}: two branches have the \"id\" {}", name, id);
  }

  std::vector<VesselBranch> branches;
  for (const nlohmann::json& entry : list) {
    const std::string field = fmt::format("{}: branch {}", name, integer(entry, "id", name));
    VesselBranch& branch = branches.emplace_back();
    if (const std::int64_t parent = integer(entry, "parent", field); parent != -1) {
      const auto found = index_of_id.find(parent);
      if (found == index_of_id.end()) throw InputError("{}: its parent {} does not exist", field, parent);
      branch.parent = found->second;
    }
    if (const auto given = entry.find("name"); given != entry.end()) branch.name = vessel_name(*given, field);
    const nlohmann::json& points = member(entry, "points", field);
    if (!points.is_array()) throw InputError("{}: \"points\" is not a list", field);
    for (const nlohmann::json& point : points) {
      if (!point.is_array() || point.size() != 4 ||
          !std::all_of(point.begin(), point.end(),
                       [](const nlohmann::json& number) { return number.is_number(); }))
        throw InputError("{}: \"points\": a point is [x, y, z, radius], not {}", field,
                         excerpt(point.dump()));
      const auto number = [&point](std::size_t i) { return point[i].get<double>(); };
      branch.points.push_back({{number(0), number(1), number(2)}, number(3)});
    }
  }
  return branches;
}

/// The tree of a file, with the names that are given beside it.
VesselTree named_tree(std::vector<VesselBranch> branches, const std::filesystem::path& path) {
  VesselTree tree(std::move(branches), path.string());
  std::error_code error;
  const std::filesystem::path names = names_beside(path);
  return !names.empty() && std::filesystem::exists(names, error) ? read_names(tree, names) : tree;
}

}  // namespace

VesselPoint point_at(const VesselBranch& branch, double at_mm) {
  const std::vector<double>& along_mm = branch.arc_length_mm;
  const auto next = std::clamp(std::upper_bound(along_mm.begin(), along_mm.end(), at_mm),
                               along_mm.begin() + 1, along_mm.end() - 1);
  const auto k = static_cast<std::size_t>(next - along_mm.begin());
  const double t = std::clamp((at_mm - along_mm[k - 1]) / (along_mm[k] - along_mm[k - 1]), 0.0, 1.0);
  const VesselPoint &a = branch.points[k - 1], &b = branch.points[k];
  return {glm::mix(a.position_mm, b.position_mm, t), std::lerp(a.radius_mm, b.radius_mm, t)};
}

VesselTree::VesselTree(std::vector<VesselBranch> branches, const std::string& name)
    : branches_(std::move(branches)), root_(complete(branches_, name)), segments_(segments_of(branches_)) {}

std::string VesselTree::title(int branch) const {
  const std::string& name = branches_[static_cast<std::size_t>(branch)].name;
  return name.empty() ? fmt::format("branch {}", branch) : name;
}

VesselTree::Location VesselTree::nearest(const glm::dvec3& point_mm) const {
  const SegmentIndex::Nearest found = segments_.nearest(point_mm);
  const auto& [segment, fraction, distance_mm] = found;
  const auto& arc_length_mm = branches_[segment.branch].arc_length_mm;
  return {
      .branch = segment.branch,
      .arc_length_mm = std::lerp(arc_length_mm[segment.point], arc_length_mm[segment.point + 1], fraction),
      .centre_mm = segment.start_mm + fraction * (segment.end_mm - segment.start_mm),
      .radius_mm = found.radius_mm(),
      .distance_mm = distance_mm};
}

glm::dvec3 centroid_mm(const VesselTree& tree) {
  glm::dvec3 sum(0);
  double weights = 0;
  for (const VesselBranch& branch : tree.branches())
    for (std::size_t i = 1; i < branch.points.size(); ++i) {
      const VesselPoint &a = branch.points[i - 1], &b = branch.points[i];
      const double radius_mm = 0.5 * (a.radius_mm + b.radius_mm),
                   weight = glm::distance(a.position_mm, b.position_mm) * radius_mm * radius_mm;
      sum += weight * 0.5 * (a.position_mm + b.position_mm);
      weights += weight;
    }
  return sum / weights;
}

void check_near_end(const glm::dvec3& end_mm, const glm::dvec3& point_mm, const std::string& name) {
  constexpr double kTolerance_mm = 50;
  if (const double away_mm = glm::distance(end_mm, point_mm); away_mm > kTolerance_mm)
    throw InputError("{}: the nearest vessel end, {:.0f},{:.0f},{:.0f}, is {:.0f} mm away", name, end_mm.x,
                     end_mm.y, end_mm.z, away_mm);
}

void write_tree(const VesselTree& tree, const std::filesystem::path& path) {
  const std::string extension = extension_of(path);
  if (extension == ".vtp") return write_lines(tree, path);
  if (extension == ".json") return write_json(tree, path);
  throw InputError("{}: a vessel tree is written as .vtp or .json, not \"{}\"", path.string(), extension);
}

std::filesystem::path tree_file_in(const std::filesystem::path& folder) {
  std::error_code error;
  for (const char* name : {"tree.vtp", "tree.json"})
    if (std::filesystem::exists(folder / name, error)) return folder / name;
  return {};
}

VesselTree read_tree(const std::filesystem::path& path) {
  return with_remedy(path, "segment the scan again or correct the file", [&]() -> VesselTree {
    std::error_code error;
    const bool is_folder = std::filesystem::is_directory(path, error);
    const std::filesystem::path file = is_folder ? tree_file_in(path) : path;
    if (file.empty())
      throw InputError(
          "{}: the folder holds neither tree.vtp nor tree.json; give one that `xraycast segment` "
          "or `xraycast vessels` wrote",
          path.string());
    const std::string extension = extension_of(file);
    if (extension == ".vtp") return named_tree(read_lines(file), file);
    if (extension == ".json") return named_tree(read_json(file), file);
    if (!std::filesystem::exists(path, error) && !error)
      throw InputError("{}: no such file or folder; check its name", path.string());
    throw InputError("{}: a vessel tree is a folder, or a file that ends in .vtp or .json; give one of these",
                     path.string());
  });
}

}  // namespace xraycast
