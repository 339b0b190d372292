#include "xraycast/segmentation/surface.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/union_find.hpp"
#include "xraycast/mask/distance_transform.hpp"
#include "xraycast/mask/smoothed_mask.hpp"

#include <glm/common.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <meshoptimizer.h>

namespace xraycast {
namespace {

/// The isosurface at the level that encloses a volume, by bisection.
Mesh mesh_of_volume(const SmoothedMask& smoothed, double target_mm3) {
  double low = 0.2, high = 0.95;
  Mesh mesh;
  for (int pass = 0; pass < 7; ++pass) {
    check_cancelled();
    const double level = pass == 0 ? 0.5 : 0.5 * (low + high);
    mesh = smoothed.isosurface(level);
    const double mm3 = volume_mm3(mesh);
    if (std::abs(mm3 / target_mm3 - 1) < 0.005) break;
    (mm3 < target_mm3 ? low : high) = level;
  }
  return mesh;
}

/// Removes pairs of triangles with the same three vertices, to which decimation collapses small features.
void remove_folds(std::vector<unsigned>& indices) {
  using Triangle = std::array<unsigned, 3>;
  std::vector<std::pair<Triangle, std::size_t>> corners;  // in ascending order, and where the triangle begins
  for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
    Triangle triangle{indices[i], indices[i + 1], indices[i + 2]};
    std::ranges::sort(triangle);
    corners.emplace_back(triangle, i);
  }
  std::ranges::sort(corners);
  std::vector<unsigned> kept;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    if (i + 1 < corners.size() && corners[i].first == corners[i + 1].first) {
      ++i;
      continue;
    }
    const auto first = indices.begin() + static_cast<std::ptrdiff_t>(corners[i].second);
    kept.insert(kept.end(), first, first + 3);
  }
  indices = std::move(kept);
}

/// Splits non-manifold edges and vertices, where sheets touch: only the two triangles of a manifold edge stay
/// joined.
Mesh with_manifold_edges(const Mesh& mesh) {
  std::map<std::pair<unsigned, unsigned>, std::vector<std::size_t>> sides;  // corners where an edge begins
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k)
      sides[{mesh.triangles[t][k], mesh.triangles[t][(k + 1) % 3]}].push_back(3 * t + k);

  UnionFind vertices(3 * mesh.triangles.size());
  const auto next = [](std::size_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; };
  for (const auto& [edge, here] : sides) {
    const auto there = sides.find({edge.second, edge.first});
    if (here.size() != 1 || there == sides.end() || there->second.size() != 1) continue;
    vertices.unite(next(there->second[0]), here[0]);
    vertices.unite(there->second[0], next(here[0]));
  }

  Mesh result;
  std::map<std::size_t, unsigned> vertex_of;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    result.triangles.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [vertex, is_new] =
          vertex_of.emplace(vertices.find(3 * t + k), static_cast<unsigned>(result.points_mm.size()));
      if (is_new) result.points_mm.push_back(mesh.points_mm[mesh.triangles[t][k]]);
      result.triangles.back()[k] = vertex->second;
    }
  }
  return result;
}

Mesh decimated(const Mesh& mesh, std::size_t triangles) {
  std::vector<unsigned> indices;
  for (const auto& t : mesh.triangles) indices.insert(indices.end(), t.begin(), t.end());
  std::vector<unsigned> kept(indices.size());
  // The error allowed is a fraction of the mesh's extent; half a percent of a trunk is a few millimetres, so
  // the number of triangles is the stopping criterion.
  constexpr float kMaxError = 0.005F;
  kept.resize(meshopt_simplify(kept.data(), indices.data(), indices.size(), &mesh.points_mm[0].x,
                               mesh.points_mm.size(), sizeof(glm::vec3), 3 * triangles, kMaxError));
  remove_folds(kept);
  Mesh result;
  std::vector<unsigned> remap(mesh.points_mm.size());
  const std::size_t count =
      meshopt_optimizeVertexFetchRemap(remap.data(), kept.data(), kept.size(), mesh.points_mm.size());
  result.points_mm.resize(count);
  for (std::size_t i = 0; i < remap.size(); ++i)
    if (remap[i] != ~0U) result.points_mm[remap[i]] = mesh.points_mm[i];
  for (std::size_t i = 0; i + 2 < kept.size(); i += 3)
    result.triangles.push_back({remap[kept[i]], remap[kept[i + 1]], remap[kept[i + 2]]});
  return with_manifold_edges(result);
}

/// What is left of a mask without its parts more than two voxels in radius.
Mask thin_parts(const Mask& mask) {
  const glm::dvec3& s = mask.geometry.spacing_mm;
  const double voxel_mm = std::max({s.x, s.y, s.z}), wide_mm = 2 * voxel_mm;
  Mask core(mask.geometry);
  const std::vector<float> depth_mm = distance_to_background_mm(mask);
  for (std::size_t i = 0; i < depth_mm.size(); ++i) core.voxels[i] = depth_mm[i] > wide_mm;
  if (core.count() == 0) return mask;
  const std::vector<float> away_mm = distance_to_foreground_mm(std::move(core));
  Mask thin(mask.geometry);
  for (std::size_t i = 0; i < away_mm.size(); ++i)
    thin.voxels[i] = static_cast<std::uint8_t>(mask.voxels[i] != 0 && away_mm[i] > wide_mm + voxel_mm);
  return thin;
}

Mesh surface_of_volume(const Mask& mask, double lumen_mm3, std::size_t triangles) {
  constexpr std::int64_t kAround_vox = 1;  // so that a vessel at the box's side has background there
  const Box box = bounding_box(mask);
  if (box.empty()) throw Error("the mask is empty, so it has no surface");
  const Mask part = crop(mask, grown(box, kAround_vox, mask.geometry.size));
  return with_fewer_triangles(mesh_of_volume(*smoothed_mask(part, thin_parts(part)), lumen_mm3), triangles);
}

}  // namespace

Mesh with_fewer_triangles(Mesh closed, std::size_t triangles) {
  if (closed.triangles.size() <= triangles) return closed;
  const double volume = volume_mm3(closed);
  for (std::size_t target = triangles; target < closed.triangles.size(); target *= 2) {
    check_cancelled();
    Mesh fewer = decimated(closed, target);
    constexpr double kShrinking = 0.01;
    if (is_watertight(fewer) && std::abs(volume_mm3(fewer) / volume - 1) < kShrinking) return fewer;
  }
  return closed;
}

Mesh surface_of(const Mask& mask, std::size_t triangles) {
  return surface_of_volume(mask, static_cast<double>(mask.count()) * voxel_mm3(mask.geometry), triangles);
}

Mesh surface_of(const Mask& mask, const LumenFill& fill, std::size_t triangles) {
  return fill.is_of_touched_voxels ? surface_of_volume(mask, fill.volume_mm3(), triangles)
                                   : surface_of(mask, triangles);
}

}  // namespace xraycast
