#include "xraycast/scene/scene.hpp"

#include "xraycast/base/error.hpp"

#include <cmath>

namespace xraycast {

Look parse_look(const std::string& name) {
  if (name == "surface") return Look::surface;
  if (name == "fluoro") return Look::fluoro;
  throw InputError("unknown look '{}'; choose surface or fluoro", excerpt(name));
}

Compositing parse_compositing(const std::string& name) {
  if (name == "wall") return Compositing::wall;
  if (name == "path") return Compositing::path;
  throw InputError("unknown compositing '{}'; choose wall or path", excerpt(name));
}

Reconstruction parse_reconstruction(const std::string& name) {
  if (name == "linear") return Reconstruction::linear;
  if (name == "constant") return Reconstruction::constant;
  throw InputError("unknown reconstruction '{}'; choose linear or constant", excerpt(name));
}

void check(const Surface& surface) {
  const Mesh& mesh = surface.mesh;
  if (!surface.mu_weights.empty() && surface.mu_weights.size() != mesh.points_mm.size())
    throw InputError("a surface of {} points has {} weights", mesh.points_mm.size(),
                     surface.mu_weights.size());
  if (const int sides = surface.tube_sides; sides > 0) {
    constexpr std::size_t kPoles = 2;
    if (mesh.points_mm.size() <= kPoles ||
        (mesh.points_mm.size() - kPoles) % static_cast<std::size_t>(sides) != 0)
      throw InputError("a tube of {} points has no rings of {}", mesh.points_mm.size(), sides);
  }
  for (std::size_t i = 0; i < mesh.points_mm.size(); ++i)
    if (const glm::vec3& p = mesh.points_mm[i]; !std::isfinite(p.x + p.y + p.z))
      throw InputError("a surface's point {} is not finite", i);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    for (const std::uint32_t corner : mesh.triangles[i])
      if (corner >= mesh.points_mm.size())
        throw InputError("a surface's triangle {} has an invalid index", i);
}

std::string to_string(Look look) { return look == Look::surface ? "surface" : "fluoro"; }

std::string to_string(Compositing compositing) { return compositing == Compositing::wall ? "wall" : "path"; }

}  // namespace xraycast
