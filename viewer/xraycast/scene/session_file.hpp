#pragma once

#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/mechanics/marker_model.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"
#include "xraycast/scene/fluoroscopy_beam.hpp"
#include "xraycast/scene/implant.hpp"
#include "xraycast/scene/scene.hpp"

#include <glm/vec3.hpp>

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// Simulated instruments as shown in a picture. Only the outline of the vessels is then visible.
struct SteeredInstruments {
  struct Instrument {
    std::vector<glm::dvec3> nodes_mm;  ///< from the introducer's far end to the tip; see curve_through
    double radius_mm = 1;
    bool has_lumen = true;                  ///< is no wire
    std::vector<MarkerModel> markers = {};  ///< as InstrumentModel's

    bool operator==(const Instrument&) const = default;
  };
  std::vector<Instrument> instruments;  ///< from the outermost on
  bool has_road_map = true;

  bool operator==(const SteeredInstruments&) const = default;
};

/// A viewer's scene and display settings, as saved and reopened. Absent files are empty paths.
struct ViewSession {
  std::filesystem::path map, basis, scan, vessels, catheter;
  double contrast_mg_ml = kUsualContrast_mg_ml;  ///< iodine in the vessels' blood
  std::vector<ImplantRequest> implants{};        ///< objects in the body, which do not move
  std::optional<SteeredInstruments> steered{};   ///< instead of vessels and catheter
  CArmPose pose{};
  Style style{};
  bool has_window = false;           ///< style.window was chosen by the user; otherwise it is automatic
  std::optional<Opacity> opacity{};  ///< recast from the basis; none: the map's own
  std::map<std::string, double> instant{};  ///< of a map that moves: the phases of its modes, 0 to 1
};

/// Writes JSON. Files are named relative to the session's folder, so that both can move together. Throws
/// InputError when `path` cannot be written.
void write_session(const ViewSession& session, const std::filesystem::path& path);

/// Reads what write_session wrote. Throws InputError, naming file and field, also when a file that it names
/// does not exist.
ViewSession read_session(const std::filesystem::path& path);

}  // namespace xraycast
