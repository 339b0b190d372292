#include "xraycast/scene/implant.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/registration/camera_file.hpp"
#include "xraycast/scene/fluoroscopy_beam.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <utility>

namespace xraycast {
namespace {

constexpr glm::dvec3 kMetal{0.75, 0.76, 0.8};

double density_of(const std::string& text, const std::string& whole) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size())
    throw InputError("object {}: a density of {}; must be a number of g/cm3", excerpt(whole), excerpt(text));
  return value;
}

void turn_inside_out(Mesh& mesh) {
  for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
}

}  // namespace

ImplantRequest parse_implant(const std::string& text) {
  ImplantRequest request;
  for (std::size_t from = 0; from <= text.size();) {
    const std::size_t end = std::min(text.find(',', from), text.size());
    const std::string word = text.substr(from, end - from);
    const std::size_t equals = word.find('=');
    const std::string name = word.substr(0, equals),
                      value = equals == std::string::npos ? "" : word.substr(equals + 1);
    if (from == 0)
      request.mesh = word;
    else if (name == "material" && !value.empty())
      request.material = value;
    else if (name == "density")
      request.g_cm3 = density_of(value, text);
    else if (name == "pose" && !value.empty())
      request.pose = value;
    else
      throw InputError("object {}: {} is none of material=NAME, density=G_CM3 and pose=FILE", excerpt(text),
                       excerpt(word));
    from = end + 1;
  }
  if (request.material.empty())
    throw InputError("object {}: what it is made of is missing; add ,material=titanium or another",
                     excerpt(text));
  return request;
}

Implant implant_of(Mesh mesh, SolidMaterial material, const std::string& name,
                   std::vector<std::string>& notes) {
  Implant implant{std::move(mesh), std::move(material)};
  if (implant.mesh.triangles.empty()) throw InputError("{}: the surface has no triangles", name);
  if (const std::size_t open = open_edges(implant.mesh); open > 0)
    throw InputError("{}: the surface is not closed, {}; close it, so that it has an inside", name,
                     open == 1 ? std::string("an edge is open") : fmt::format("{} edges are open", open));
  const double volume = volume_mm3(implant.mesh);
  if (volume == 0) throw InputError("{}: the surface is flat, and encloses nothing", name);
  if (volume < 0) {
    turn_inside_out(implant.mesh);
    notes.push_back(
        fmt::format("{}: its triangles are wound inwards; the surface was turned inside out", name));
  }
  return implant;
}

Implant read_implant(const ImplantRequest& request, std::vector<std::string>& notes) {
  const std::string name = request.mesh.string();
  SolidMaterial material = solid_named(request.material, request.g_cm3);
  if (!std::filesystem::exists(request.mesh)) throw InputError("{}: no such file; check its name", name);
  Implant implant = implant_of(read_mesh(request.mesh), std::move(material), name, notes);
  if (!request.pose.empty()) {
    const RigidMotion motion = read_motion_matrix(request.pose);
    for (glm::vec3& point : implant.mesh.points_mm) point = glm::vec3(motion(glm::dvec3(point)));
  }
  return implant;
}

std::vector<Implant> read_implants(const std::vector<ImplantRequest>& requests,
                                   std::vector<std::string>& notes) {
  std::vector<Implant> implants;
  implants.reserve(requests.size());
  for (const ImplantRequest& request : requests) implants.push_back(read_implant(request, notes));
  return implants;
}

Surface surface_of(const Implant& implant) {
  return {implant.mesh, fluoroscopy_per_mm(implant.material), kMetal};
}

std::vector<Surface> surfaces_of(const std::vector<Implant>& implants) {
  std::vector<Surface> surfaces;
  surfaces.reserve(implants.size());
  for (const Implant& implant : implants) surfaces.push_back(surface_of(implant));
  return surfaces;
}

}  // namespace xraycast
