#include "xraycast/geometry/curved_axis.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/branch_names.hpp"
#include "xraycast/geometry/vessel_tree.hpp"

#include <glm/common.hpp>

#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>
#include <string_view>

namespace xraycast {
namespace {

/// x, y and z at the start of a CSV line; nothing for other lines.
std::optional<glm::dvec3> parse_point(std::string line) {
  std::ranges::replace_if(
      line, [](char c) { return c == ',' || c == ';'; }, ' ');
  std::istringstream numbers(line);
  glm::dvec3 point;
  return numbers >> point.x >> point.y >> point.z ? std::optional(point) : std::nullopt;
}

std::vector<glm::dvec3> read_csv(const std::string& path) {
  std::istringstream file(read_whole_file(path));
  std::vector<glm::dvec3> points_mm;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos || line[0] == '#') continue;
    const std::optional<glm::dvec3> point_mm = parse_point(line);
    if (!point_mm && number == 1) continue;  // a heading
    if (!point_mm) throw InputError("{}: line {} is not x,y,z in mm", path, number);
    points_mm.push_back(*point_mm);
  }
  return points_mm;
}

/// A branch by its number, or all branches of a vessel by its name, those one behind the other.
std::vector<int> branches_chosen(const VesselTree& tree, const std::string& choice, const std::string& name) {
  std::size_t number = 0;
  if (!parse_whole(choice, number)) return branches_named(tree, choice, name);
  if (number >= tree.branches().size())
    throw InputError("{}: there is no branch {}; they are numbered 0 to {}", name, number,
                     tree.branches().size() - 1);
  return {static_cast<int>(number)};
}

std::vector<glm::dvec3> read_branches(const std::string& path, const std::string& choice,
                                      const std::string& name) {
  const VesselTree tree = read_tree(path);
  const std::vector<int> chosen = branches_chosen(tree, choice, name);
  const auto branch = [&](int i) -> const VesselBranch& {
    return tree.branches()[static_cast<std::size_t>(i)];
  };
  const auto goes_on = [&](int i) { return std::ranges::find(chosen, branch(i).parent) != chosen.end(); };
  auto next = std::ranges::find_if_not(chosen, goes_on);
  std::vector<glm::dvec3> points_mm;
  for (std::size_t left = chosen.size(); left > 0; --left) {
    for (const VesselPoint& point : branch(*next).points)
      if (points_mm.empty() || point.position_mm != points_mm.back()) points_mm.push_back(point.position_mm);
    const int last = *next;
    next = std::ranges::find_if(chosen, [&](int i) { return branch(i).parent == last; });
    if (left > 1 && next == chosen.end())
      throw InputError("{}: the branches of this name do not follow one another; give a number", name);
  }
  return points_mm;
}

}  // namespace

CurvedAxis::CurvedAxis(std::vector<glm::dvec3> points_mm, const std::string& name)
    : points_mm_(std::move(points_mm)) {
  if (points_mm_.size() < 2) throw InputError("{}: a centre line needs at least two points", name);
  if (points_mm_.back().z < points_mm_.front().z) std::ranges::reverse(points_mm_);
  for (std::size_t i = 0; i < points_mm_.size(); ++i) {
    const glm::dvec3& p = points_mm_[i];
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
      throw InputError("{}: the centre line has a point that is not finite", name);
    if (i > 0 && !(p.z > points_mm_[i - 1].z))
      throw InputError("{}: the centre line turns back at z = {:g} mm; it must rise or fall monotonically",
                       name, p.z);
  }
}

CurvedAxis CurvedAxis::from_file(const std::string& name) {
  const auto hash = name.rfind('#');
  const std::string path = name.substr(0, hash);
  const std::string extension = extension_of(path);
  const std::string branch = hash == std::string::npos ? "0" : name.substr(hash + 1);
  return with_remedy(path, "correct the file", [&]() -> CurvedAxis {
    return {extension == ".vtp" || extension == ".json" ? read_branches(path, branch, name) : read_csv(path),
            name};
  });
}

glm::dvec2 CurvedAxis::at_mm(double z_mm) const {
  const auto above = std::ranges::lower_bound(points_mm_, z_mm, {}, &glm::dvec3::z);
  if (above == points_mm_.begin()) return points_mm_.front();
  if (above == points_mm_.end()) return points_mm_.back();
  const glm::dvec3 &a = *std::prev(above), &b = *above;
  return glm::dvec2(glm::mix(a, b, (z_mm - a.z) / (b.z - a.z)));
}

std::vector<glm::dvec2> CurvedAxis::centre_of_rows_mm(const VolumeGeometry& volume) const {
  std::vector<glm::dvec2> centres_mm;
  for (std::int64_t z = volume.size.z - 1; z >= 0; --z)
    centres_mm.push_back(at_mm(volume.to_world_mm({0, 0, static_cast<double>(z)}).z));
  return centres_mm;
}

}  // namespace xraycast
