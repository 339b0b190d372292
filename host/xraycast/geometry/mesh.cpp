#include "xraycast/geometry/mesh.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/geometry/legacy_vtk.hpp"
#include "xraycast/geometry/mesh_builder.hpp"
#include "xraycast/geometry/obj.hpp"
#include "xraycast/geometry/ply.hpp"
#include "xraycast/geometry/stl.hpp"
#include "xraycast/geometry/vtp.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <iterator>
#include <string>
#include <string_view>

namespace xraycast {
namespace {

void write_polys(const Mesh& mesh, const std::filesystem::path& path) {
  PolyData data;
  data.point_type = VtkType::kFloat32;
  data.points_mm.assign(mesh.points_mm.begin(), mesh.points_mm.end());
  for (const auto& triangle : mesh.triangles) data.polys.add(triangle);
  write_vtp(data, path);
}

Mesh mesh_of(const PolyData& data, const std::string& name) {
  MeshBuilder builder(name);
  for (const glm::dvec3& point_mm : data.points_mm) builder.add_point(point_mm, "Points: point");
  for (std::size_t i = 0; i < data.polys.size(); ++i) builder.add_polygon(data.polys[i], "Polys: polygon", i);
  for (std::size_t i = 0; i < data.strips.size(); ++i) builder.add_strip(data.strips[i]);
  Mesh mesh = builder.take();
  mesh.says_space = data.says_space;
  return mesh;
}

/// Own readers: of 120 damaged PLY files assimp 5.2.5 crashed on 28, and took more than ten seconds for
/// three.
struct SurfaceFormat {
  std::string_view extension;
  Mesh (*read)(const std::filesystem::path&);
};
constexpr SurfaceFormat kSurfaceFormats[] = {
    {".stl", read_stl},
    {".vtp", [](const std::filesystem::path& path) { return mesh_of(read_vtp(path), path.string()); }},
    {".vtk", [](const std::filesystem::path& path) { return mesh_of(read_legacy_vtk(path), path.string()); }},
    {".obj", read_obj},
    {".ply", read_ply}};

const SurfaceFormat* surface_format(const std::filesystem::path& path) {
  const auto* const format =
      std::ranges::find(kSurfaceFormats, extension_of(path), &SurfaceFormat::extension);
  return format == std::end(kSurfaceFormats) ? nullptr : format;
}

/// The edges that triangles run along, as two numbers of points, sorted, and the same turned round; without
/// those between a point and itself.
struct DirectedEdges {
  std::vector<std::uint64_t> edges, reversed;
};

DirectedEdges directed_edges(const Mesh& mesh) {
  DirectedEdges all;
  for (const auto& triangle : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t from = triangle[k], to = triangle[(k + 1) % 3];
      if (from == to) continue;
      all.edges.push_back(from << 32 | to);
      all.reversed.push_back(to << 32 | from);
    }
  std::ranges::sort(all.edges);
  std::ranges::sort(all.reversed);
  return all;
}

}  // namespace

bool is_watertight(const Mesh& mesh) {
  const auto [edges, reversed] = directed_edges(mesh);
  return edges.size() == 3 * mesh.triangles.size() && edges == reversed &&
         std::ranges::adjacent_find(edges) == edges.end();
}

std::size_t open_edges(const Mesh& mesh) {
  const auto [edges, reversed] = directed_edges(mesh);
  std::vector<std::uint64_t> open;
  std::ranges::set_difference(edges, reversed, std::back_inserter(open));
  return open.size();
}

double volume_mm3(const Mesh& mesh) {
  if (mesh.points_mm.empty()) return 0;
  const glm::dvec3 apex = mesh.points_mm.front();  // near the surface, against cancellation
  double sum = 0;
  for (const auto& [a, b, c] : mesh.triangles)
    sum += glm::dot(glm::dvec3(mesh.points_mm[a]) - apex,
                    glm::cross(glm::dvec3(mesh.points_mm[b]) - apex, glm::dvec3(mesh.points_mm[c]) - apex));
  return sum / 6;
}

void write_mesh(const Mesh& mesh, const std::filesystem::path& path) {
  const std::string extension = extension_of(path);
  if (extension == ".stl") return write_stl(mesh, path);
  if (extension == ".vtp") return write_polys(mesh, path);
  throw InputError("{}: a surface is written as .stl or .vtp, not \"{}\"", path.string(), extension);
}

bool is_surface_file(const std::filesystem::path& path) { return surface_format(path) != nullptr; }

Mesh read_mesh(const std::filesystem::path& path) {
  return with_remedy(path, "export the surface again as STL, VTP, VTK, OBJ or PLY", [&] {
    const SurfaceFormat* const format = surface_format(path);
    if (!format)
      throw InputError("{}: a surface is read from .stl, .vtp, .vtk, .obj or .ply, not \"{}\"", path.string(),
                       extension_of(path));
    return format->read(path);
  });
}

}  // namespace xraycast
