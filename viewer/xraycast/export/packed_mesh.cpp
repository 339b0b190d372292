#include "xraycast/export/packed_mesh.hpp"

#include "xraycast/export/packed_numbers.hpp"

#include <array>
#include <cmath>

namespace xraycast {
namespace {

std::string pack_points(const Mesh& mesh, std::size_t ring) {
  std::vector<std::array<std::int64_t, 3>> steps;
  for (const glm::vec3& point : mesh.points_mm) {
    std::array<std::int64_t, 3> step{};
    for (int axis = 0; axis < 3; ++axis)
      step[static_cast<std::size_t>(axis)] = std::llround(double{point[axis]} / PackedMesh::kUnit_mm);
    steps.push_back(step);
  }
  PackedNumbers packed;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto before = [&](std::size_t i, std::size_t count) {
      return i >= count ? steps[i - count][axis] : 0;
    };
    for (std::size_t i = 0; i < steps.size(); ++i)
      packed.add(steps[i][axis] - before(i, 1) - (ring > 0 ? before(i, ring) - before(i, ring + 1) : 0));
  }
  return packed.bytes();
}

}  // namespace

PackedMesh pack_mesh(const Mesh& mesh) {
  PackedMesh packed{pack_points(mesh, 0), {}, 0};
  for (const int ring : {12, 24})  // as tubes have them
    if (std::string points = pack_points(mesh, static_cast<std::size_t>(ring));
        points.size() < packed.points.size()) {
      packed.points = std::move(points);
      packed.ring = ring;
    }
  const bool is_inside_out = volume_mm3(mesh) < 0;
  PackedNumbers triangles;
  std::array<std::uint32_t, 3> before{};
  for (auto triangle : mesh.triangles) {
    if (is_inside_out) std::swap(triangle[1], triangle[2]);
    for (std::size_t corner = 0; corner < 3; ++corner)
      triangles.add(std::int64_t{triangle[corner]} - std::int64_t{before[corner]});
    before = triangle;
  }
  packed.triangles = triangles.bytes();
  return packed;
}

}  // namespace xraycast
