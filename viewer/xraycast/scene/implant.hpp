#pragma once

#include "xraycast/attenuation/solid_material.hpp"
#include "xraycast/scene/scene.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// An object in the body, such as a plate, a screw, a valve or a coil: a closed surface of one material.
struct ImplantRequest {
  std::filesystem::path mesh;  ///< of any format of read_mesh, in the scan's mm
  std::string material;        ///< of solid_named
  std::optional<double> g_cm3{};
  std::filesystem::path
      pose{};  ///< a file of read_motion_matrix, by which the mesh's points move; none: they stay

  bool operator==(const ImplantRequest&) const = default;
};

/// `FILE.stl,material=titanium[,density=G_CM3][,pose=FILE]`. Throws InputError.
ImplantRequest parse_implant(const std::string& text);

struct Implant {
  Mesh mesh;  ///< in the scan's mm, normals outwards
  SolidMaterial material;
};

/// A surface that is inside out is turned, which a note says. Throws InputError, with `name` in front, for
/// one that is not closed, with the number of its open edges, and for one that encloses nothing.
Implant implant_of(Mesh mesh, SolidMaterial material, const std::string& name,
                   std::vector<std::string>& notes);

/// Reads its files. Throws InputError as implant_of, read_mesh, solid_named and read_motion_matrix.
Implant read_implant(const ImplantRequest& request, std::vector<std::string>& notes);
std::vector<Implant> read_implants(const std::vector<ImplantRequest>& requests,
                                   std::vector<std::string>& notes);

/// As it attenuates in a fluoroscopy beam; see fluoroscopy_per_mm.
Surface surface_of(const Implant& implant);
std::vector<Surface> surfaces_of(const std::vector<Implant>& implants);

}  // namespace xraycast
