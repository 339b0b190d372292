#pragma once

#include "xraycast/catheter/hub.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/scene/device_tubes.hpp"
#include "xraycast/simulation/tip_pressures.hpp"

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
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
    double balloon_mm = 0;             ///< its diameter; 0 without a balloon
    int free_rings = 0;                ///< of its stent, that have left its sheath
    std::optional<PushedCoil> coil{};  ///< on its wire
    PressureReading pressure{};        ///< of the blood at its tip
    /// At the last exposure: the control points of each part's curve (see lengths_of and controls_of).
    std::vector<std::vector<glm::dvec3>> parts_mm;
  };

  double time_s = 0, fluoroscopy_s = 0, injected_ml = 0, aortic_mmHg = 0;
  double packing = 0;  ///< density of the coils in the sac that is packed most densely
  bool exposes = false, injects = false, is_valve_locked = false;
  bool has_outlet = true;  ///< for contrast agent: a lumen is free
  std::size_t held_hub = 0;
  std::uint32_t exposures = 0;            ///< so far; the picture changes with it
  std::vector<Instrument> instruments{};  ///< from the outermost on
  /// At the last exposure: balloons, stents on their way, and those that were left, where they are seen.
  std::vector<DeviceTube> devices{};
  std::vector<float> drums_mg_ml{};   ///< at the last exposure: iodine in the drums of a ContrastSurface
  std::vector<glm::vec2> drums_mm{};  ///< then: the radii of their ends, which balloons and stents widen

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

/// What an instrument's balloon and stent are like.
void tell_treating(BrowserMessage::Instrument& told, const InstrumentModel& model, const TreatingView& view);

/// Its bytes: little-endian, all numbers of four bytes but the first four, of one (docs/web.md). Drums
/// without iodine are left out, as all of the body is where it has no modes.
std::string packed(const BrowserMessage& message);

}  // namespace xraycast
