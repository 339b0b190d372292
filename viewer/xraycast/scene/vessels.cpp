#include "xraycast/scene/vessels.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/moved_vessels.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/scene/fluoroscopy_beam.hpp"

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <sstream>
#include <utility>

namespace xraycast {
namespace {

constexpr double kCatheterRadius_mm = 1, kLumenRadius_mm = 0.6;

Mesh mesh_of_folder(const std::filesystem::path& folder) {
  for (const char* name : {"surface.vtp", "surface.stl"})
    if (std::filesystem::exists(folder / name)) return read_mesh(folder / name);
  if (!tree_file_in(folder).empty()) return tube_mesh(read_tree(folder));
  throw InputError(
      "{}: the folder holds neither a surface (surface.vtp, surface.stl) nor a tree (tree.vtp, tree.json); "
      "give the one that `xraycast segment` wrote",
      folder.string());
}

}  // namespace

double catheter_per_mm() {
  constexpr double kTubing_mg_ml = 1600, kFiller = 0.4, kBariumOfSulphate = 137.33 / 233.39;
  constexpr double kLumen = kLumenRadius_mm / kCatheterRadius_mm;
  static const double per_mm =
      fluoroscopy_per_mm("Ba", kTubing_mg_ml * kFiller * kBariumOfSulphate) * (1 - kLumen * kLumen);
  return per_mm;
}

Surface filled_vessels(Mesh mesh, double contrast_mg_ml) {
  if (!(contrast_mg_ml >= 0 && contrast_mg_ml <= kMaxContrast_mg_ml))
    throw InputError("`contrast_mg_ml` {:g}: must be 0 to {:g}", contrast_mg_ml, kMaxContrast_mg_ml);
  return {std::move(mesh), fluoroscopy_per_mm("I", contrast_mg_ml), {0.80, 0.16, 0.14}};
}

Surface read_vessels(const std::filesystem::path& path, double contrast_mg_ml) {
  if (!std::filesystem::exists(path))
    throw InputError("{}: no such file or folder; check its name", path.string());
  Surface vessels = filled_vessels({}, contrast_mg_ml);
  vessels.mesh = std::filesystem::is_directory(path) ? mesh_of_folder(path) : read_mesh(path);
  if (vessels.mesh.triangles.empty())
    throw InputError("{}: the surface has no triangles; segment the scan again", path.string());
  return vessels;
}

Surface moved(Surface vessels, const HeldMotion& motion, const std::string& name,
              std::vector<std::string>& notes) {
  MovedVessels<Mesh> found = moved(std::move(vessels.mesh), motion);
  vessels.mesh = std::move(found.vessels);
  for (std::string& note : found.lost.notes(name)) notes.push_back(std::move(note));
  return vessels;
}

std::vector<std::string> notes_on_place(std::span<const glm::vec3> vessels_mm, const BodyBounds& bounds,
                                        const std::string& name) {
  const auto within =
      std::ranges::count_if(vessels_mm, [&](const glm::vec3& point) { return bounds.holds(point); });
  const double outside = 1 - static_cast<double>(within) / static_cast<double>(vessels_mm.size());
  if (!(outside > 0.5)) return {};
  return {fmt::format("{}: {:.0f} % of it lies outside the body map; check that both come from the same scan",
                      name, 100 * outside)};
}

std::vector<std::string> notes_on_place(const VesselTree& vessels, const BodyBounds& bounds,
                                        const std::string& name) {
  std::vector<glm::vec3> points_mm;
  for (const VesselBranch& branch : vessels.branches())
    for (const VesselPoint& point : branch.points) points_mm.emplace_back(point.position_mm);
  return notes_on_place(points_mm, bounds, name);
}

Surface read_catheter(const std::filesystem::path& path) {
  std::istringstream lines(read_whole_file(path));
  std::vector<glm::dvec3> points;
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    std::ranges::replace(line, ',', ' ');
    std::istringstream fields(line);
    glm::dvec3 p;
    if (fields >> p.x >> p.y >> p.z)
      points.push_back(p);
    else if (number > 1 && line.find_first_not_of(" \t\r") != std::string::npos)
      throw InputError("{}: line {} is not x, y, z; correct it", path.string(), number);
  }
  constexpr int kRingsPerPoint = 16, kSides = 12;
  return {tube_mesh(NurbsCurve::cubic(points, path.string()), kCatheterRadius_mm, kRingsPerPoint, kSides),
          catheter_per_mm(),
          kCatheterColour,
          {},
          kSides};
}

Mesh tube_mesh(const NurbsCurve& curve, double radius_mm, int rings_per_point, int sides) {
  const auto count = rings_per_point * static_cast<int>(curve.points().size());
  VesselBranch branch;
  for (int i = 0; i <= count; ++i) {
    const glm::dvec3 p = curve.at_mm(static_cast<double>(i) / count);
    if (branch.points.empty() || glm::distance(p, branch.points.back().position_mm) > 1e-6)
      branch.points.push_back({p, radius_mm});
  }
  return tube_mesh(VesselTree({std::move(branch)}, "catheter"), sides);
}

}  // namespace xraycast
