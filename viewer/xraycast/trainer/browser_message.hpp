#pragma once

#include "xraycast/catheter/hub.hpp"

#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace xraycast {

/// What browsers are told of a session, once a frame.
struct BrowserMessage {
  struct Instrument {
    HubPose pose;
    HubLoad load;
    std::size_t tip_branch = 0;  ///< of the vessel tree, and how far along it the tip is
    double tip_along_mm = 0;
    /// At the last exposure: the control points of each part's curve (see lengths_of and controls_of).
    std::vector<std::vector<glm::dvec3>> parts_mm;
  };

  double time_s = 0, fluoroscopy_s = 0, injected_ml = 0;
  bool exposes = false, injects = false, is_valve_locked = false;
  bool has_outlet = true;  ///< for contrast agent: a lumen is free
  std::size_t held_hub = 0;
  std::uint32_t exposures = 0;            ///< so far; the picture changes with it
  std::vector<Instrument> instruments{};  ///< from the outermost on
  std::vector<float> drums_mg_ml{};       ///< at the last exposure: iodine in the drums of a ContrastSurface

  /// A mode of a body in motion.
  struct Mode {
    bool is_held = false, is_gate = false;  ///< exposures wait for its phase `gate`
    double phase = 0;                       ///< at the last exposure
    double gate = 0;
    std::vector<float> trace{};  ///< since the last message, 5 ms apart up to `body_time_s`, 0 to 1
  };
  double body_time_s = 0, body_speed = 1;
  std::vector<Mode> modes{};                ///< none where the body is still
  std::vector<glm::vec3> drums_moved_mm{};  ///< at the last exposure: how far the body has moved each drum
  std::vector<double> exposures_s{};        ///< since the last message, by the body's clock
};

/// Its bytes: little-endian, all numbers of four bytes but the first four, of one (docs/web.md). Drums
/// without iodine are left out, as all of the body is where it has no modes.
std::string packed(const BrowserMessage& message);

}  // namespace xraycast
