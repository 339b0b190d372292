#pragma once

#include <glm/vec3.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

namespace xraycast {

/// A triangle surface in LPS millimetres, normals outwards (counter-clockwise seen from outside).
struct Mesh {
  std::vector<glm::vec3> points_mm;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  bool says_space = false;  ///< of a file: it says in which space its points were
};

/// Every undirected edge belongs to exactly two triangles that run along it in opposite directions.
bool is_watertight(const Mesh& mesh);

/// The number of edges that a triangle runs along and no other runs back along: 0 where the surface has an
/// inside, also where parts of it touch in edges.
std::size_t open_edges(const Mesh& mesh);

/// Signed volume by the divergence theorem; positive when the normals point outwards. For closed surfaces.
double volume_mm3(const Mesh& mesh);

/// Binary STL (its header carries `SPACE=LPS`, which 3D Slicer reads) or VTK XML PolyData, by the extension
/// `.stl` or `.vtp`. Throws InputError for another extension or a target that cannot be written, Error when
/// the disk is full.
void write_mesh(const Mesh& mesh, const std::filesystem::path& path);

/// Whether read_mesh reads a file of that name, by its extension.
bool is_surface_file(const std::filesystem::path& path);

/// Reads what write_mesh writes, and other programs' files, by the extension: STL (binary or ASCII), VTP (see
/// read_vtp), `.vtk` (VTK before XML, PolyData), OBJ and PLY (ASCII or binary). Polygons are split into
/// triangle fans, strips into triangles; points of an STL that coincide exactly are merged; a file marked
/// `SPACE=RAS`, as 3D Slicer does in headers and comments, is converted to LPS. Throws InputError when the
/// file is damaged, has points that are not finite or beyond any body (body_bounds.hpp), or indices out of
/// range, and for an OBJ or PLY without faces.
Mesh read_mesh(const std::filesystem::path& path);

}  // namespace xraycast
