#include "xraycast/scene/scene.hpp"

#include "xraycast/base/error.hpp"

#include <cmath>

namespace xraycast {

Look parse_look(const std::string& name) {
  if (name == "surface") return Look::surface;
  if (name == "fluoro") return Look::fluoro;
  throw InputError("'{}' is not a look; there are surface and fluoro", name);
}

Compositing parse_compositing(const std::string& name) {
  if (name == "wall") return Compositing::wall;
  if (name == "path") return Compositing::path;
  throw InputError("'{}' is not a compositing of body maps; there are wall and path", name);
}

void check(const Surface& surface) {
  const Mesh& mesh = surface.mesh;
  if (!surface.shares.empty() && surface.shares.size() != mesh.points_mm.size())
    throw InputError("a surface of {} points has {} shares", mesh.points_mm.size(), surface.shares.size());
  for (std::size_t i = 0; i < mesh.points_mm.size(); ++i)
    if (const glm::vec3& p = mesh.points_mm[i]; !std::isfinite(p.x + p.y + p.z))
      throw InputError("a surface's point {} is not finite", i);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    for (const std::uint32_t corner : mesh.triangles[i])
      if (corner >= mesh.points_mm.size()) throw InputError("a surface's triangle {} names no point", i);
}

std::string to_string(Look look) { return look == Look::surface ? "surface" : "fluoro"; }

std::string to_string(Compositing compositing) { return compositing == Compositing::wall ? "wall" : "path"; }

}  // namespace xraycast
