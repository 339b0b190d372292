#include "xraycast/geometry/mesh_builder.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/geometry/body_bounds.hpp"

#include <cmath>

namespace xraycast {

void MeshBuilder::add_point(const glm::dvec3& stored_mm, const char* field) {
  check_surface_point(stored_mm, name_, field, points());
  mesh_.points_mm.emplace_back(sign_ * stored_mm.x, sign_ * stored_mm.y, stored_mm.z);
}

void MeshBuilder::add_polygon(std::span<const std::uint32_t> corners, const char* field, std::size_t number) {
  if (corners.size() < 3)
    throw InputError("{}: {} {} has {}", name_, field, number, pluralize(corners.size(), "corner"));
  for (std::size_t k = 2; k < corners.size(); ++k)
    mesh_.triangles.push_back({corners[0], corners[k - 1], corners[k]});
}

void MeshBuilder::add_strip(std::span<const std::uint32_t> corners) {
  for (std::size_t k = 2; k < corners.size(); ++k)
    mesh_.triangles.push_back({corners[k - 2 + k % 2], corners[k - 1 - k % 2], corners[k]});
}

Mesh MeshBuilder::take() {
  for (const auto& triangle : mesh_.triangles)
    for (const std::uint32_t corner : triangle)
      if (corner >= points())
        throw InputError("{}: a face has the corner {}, but there are {}", name_, corner,
                         pluralize(points(), "point"));
  return std::move(mesh_);
}

void check_surface_point(const glm::dvec3& point_mm, std::string_view file, const char* field,
                         std::size_t number) {
  for (int axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(point_mm[axis]))
      throw InputError("{}: {} {} is not finite; export the surface again", file, field, number);
    if (std::abs(point_mm[axis]) > kFarthest_mm)
      throw InputError("{}: {} {} lies {:g} mm from the origin, more than {:g}; export the surface in mm",
                       file, field, number, std::abs(point_mm[axis]), kFarthest_mm);
  }
}

}  // namespace xraycast
