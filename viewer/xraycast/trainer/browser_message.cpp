#include "xraycast/trainer/browser_message.hpp"

#include "xraycast/scene/contrast_surface.hpp"

#include <bit>
#include <numbers>

namespace xraycast {
namespace {

constexpr unsigned kFormat = 5;
constexpr unsigned kExposes = 1, kInjects = 2, kIsLocked = 4, kHasOutlet = 8;
constexpr unsigned kCanBeDetached = 1, kIsOutside = 2;  // of a coil
constexpr unsigned kIsHeld = 1, kIsGate = 2;            // of a mode

/// Numbers as they lie in memory, one behind the other.
class Numbers {
 public:
  void byte(std::size_t value) { bytes_ += static_cast<char>(value); }
  void whole(std::size_t value) { add(static_cast<std::uint32_t>(value)); }
  void real(double value) { add(static_cast<float>(value)); }
  std::string bytes() && { return std::move(bytes_); }

 private:
  template <typename Value>
  void add(Value value) {
    static_assert(sizeof value == 4 && std::endian::native == std::endian::little);  // as in browsers
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  std::string bytes_;
};

void add_coil(const std::optional<PushedCoil>& coil, Numbers& numbers) {
  const PushedCoil shown = coil.value_or(PushedCoil{});
  numbers.whole((coil && coil->can_be_detached() ? kCanBeDetached : 0u) |
                (coil && coil->is_outside() ? kIsOutside : 0u));
  numbers.real(shown.model.loop_mm);
  numbers.real(shown.model.length_mm);
  numbers.real(shown.laid_mm);
}

void add_instrument(const BrowserMessage::Instrument& instrument, Numbers& numbers) {
  numbers.real(instrument.pose.insertion_mm);
  numbers.real(instrument.pose.rotation_rad * 180 / std::numbers::pi);
  numbers.real(instrument.load.force_N);
  numbers.real(1000 * instrument.load.torque_Nm);
  numbers.whole(instrument.tip_branch);
  numbers.real(instrument.tip_along_mm);
  numbers.real(instrument.pose.inflation_bar);
  numbers.real(instrument.balloon_mm);
  numbers.real(instrument.pose.release_mm);
  numbers.whole(static_cast<std::size_t>(instrument.free_rings));
  numbers.whole(static_cast<std::size_t>(instrument.pose.detach));
  add_coil(instrument.coil, numbers);
  numbers.real(instrument.pressure.now_mmHg);
  numbers.real(instrument.pressure.systolic_mmHg);
  numbers.real(instrument.pressure.diastolic_mmHg);
  numbers.real(instrument.pressure.mean_mmHg);
  numbers.whole(instrument.parts_mm.size());
  for (const std::vector<glm::dvec3>& part_mm : instrument.parts_mm) {
    numbers.whole(part_mm.size());
    for (const glm::dvec3& point_mm : part_mm)
      for (int axis = 0; axis < 3; ++axis) numbers.real(point_mm[axis]);
  }
}

void add_devices(const std::vector<DeviceTube>& tubes, Numbers& numbers) {
  numbers.whole(tubes.size());
  for (const DeviceTube& tube : tubes) {
    numbers.whole(static_cast<std::size_t>(tube.matter));
    numbers.real(tube.inner_radius_mm);
    numbers.whole(tube.points.size());
    for (const VesselPoint& point : tube.points) {
      for (int axis = 0; axis < 3; ++axis) numbers.real(point.position_mm[axis]);
      numbers.real(point.radius_mm);
    }
  }
}

/// Those with iodine.
std::vector<std::size_t> filled_drums(const std::vector<float>& drums_mg_ml) {
  std::vector<std::size_t> filled;
  for (std::size_t drum = 0; drum < drums_mg_ml.size(); ++drum)
    if (drums_mg_ml[drum] > ContrastSurface::kNothing_mg_ml) filled.push_back(drum);
  return filled;
}

void add_drums(const BrowserMessage& message, Numbers& numbers) {
  const std::vector<std::size_t> filled = filled_drums(message.drums_mg_ml);
  numbers.whole(filled.size());
  for (const std::size_t drum : filled) {
    numbers.whole(drum);
    numbers.real(message.drums_mg_ml[drum]);
    for (int end = 0; end < 2; ++end)
      numbers.real(drum < message.drums_mm.size() ? message.drums_mm[drum][end] : 0);
  }
}

void add_moved_drums(const BrowserMessage& message, Numbers& numbers) {
  for (const std::size_t drum : filled_drums(message.drums_mg_ml)) {
    const bool is_known = drum < message.drums_moved_mm.size();
    for (int axis = 0; axis < 3; ++axis) numbers.real(is_known ? message.drums_moved_mm[drum][axis] : 0);
  }
}

void add_modes(const BrowserMessage& message, Numbers& numbers) {
  numbers.whole(message.modes.size());
  if (message.modes.empty()) return;
  numbers.real(message.body_time_s);
  numbers.real(message.body_speed);
  for (const BrowserMessage::Mode& mode : message.modes) {
    numbers.whole((mode.is_held ? kIsHeld : 0u) | (mode.is_gate ? kIsGate : 0u));
    numbers.real(mode.phase);
    numbers.real(mode.gate);
    numbers.whole(mode.trace.size());
    for (const float value : mode.trace) numbers.real(value);
  }
  numbers.whole(message.exposures_s.size());
  for (const double time_s : message.exposures_s) numbers.real(time_s);
  add_moved_drums(message, numbers);
}

}  // namespace

void tell_treating(BrowserMessage::Instrument& told, const InstrumentModel& model, const TreatingView& view) {
  told.balloon_mm = model.balloon() ? 2 * model.balloon_radius_mm(view.bar) : 0;
  told.free_rings = model.has_sheath() ? model.stent()->rings - view.carried_rings : 0;
}

std::string packed(const BrowserMessage& message) {
  Numbers numbers;
  numbers.byte(kFormat);
  numbers.byte((message.exposes ? kExposes : 0u) | (message.injects ? kInjects : 0u) |
               (message.is_valve_locked ? kIsLocked : 0u) | (message.has_outlet ? kHasOutlet : 0u));
  numbers.byte(message.held_hub);
  numbers.byte(message.instruments.size());
  numbers.whole(message.exposures);
  numbers.real(message.time_s);
  numbers.real(message.fluoroscopy_s);
  numbers.real(message.injected_ml);
  numbers.real(message.aortic_mmHg);
  numbers.real(message.packing);
  for (const BrowserMessage::Instrument& instrument : message.instruments)
    add_instrument(instrument, numbers);
  add_devices(message.devices, numbers);
  add_drums(message, numbers);
  add_modes(message, numbers);
  return std::move(numbers).bytes();
}

}  // namespace xraycast
