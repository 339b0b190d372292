#pragma once

#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/contrast_agent/contrast_bolus.hpp"
#include "xraycast/haptics/hub_couplings.hpp"
#include "xraycast/haptics/manual_device.hpp"
#include "xraycast/scene/contrast_surface.hpp"
#include "xraycast/simulation/run_monitor.hpp"
#include "xraycast/simulation/tip_pressures.hpp"
#include "xraycast/trainer/browser_message.hpp"
#include "xraycast/trainer/trainer_body.hpp"
#include "xraycast/trainer/trainer_setup.hpp"

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// What a hand holds down.
struct TrainerHand {
  double push = 0, turn = 0;  ///< -1 to 1, of the hub that is held
  bool is_slow = false, pedal = false, injects = false;
};

/// An insertion in mm, a rotation in rad, a balloon's pressure in bar, how far a sheath is drawn back, in mm,
/// and how many coils were to be detached.
inline constexpr std::size_t kPoseNumbers = 5;
std::array<double, kPoseNumbers> numbers_of(const HubPose& pose);
HubPose pose_of(std::span<const double, kPoseNumbers> numbers);

/// Instruments steered by hand in one thread, which its owner steps: a page without a server has it in a
/// worker, as WebAssembly. What it tells is what a server of a live session tells (docs/web.md), but how
/// drums of contrast agent move, which the page knows by itself. It has no clock but its steps, of a
/// millisecond each.
class Trainer {
 public:
  /// Throws InputError where the instruments do not fit.
  explicit Trainer(TrainerSetup setup);

  void hold(const TrainerHand& hand) { hand_ = hand; }

  /// Exposures a second while the pedal is down, the first one at once. Without, one a message.
  void set_pulse_rate(double per_s) { pulses_per_s_ = per_s; }

  /// What the page's fluoroscope has given by now, for the report. From then on the fluoroscopy time is its
  /// own, without cine, and no longer that of the pedal.
  void count_dose(double fluoroscopy_s, double air_kerma_mGy, double dap_Gycm2) {
    fluoroscopy_s_ = fluoroscopy_s;
    air_kerma_mGy_ = air_kerma_mGy;
    dap_Gycm2_ = dap_Gycm2;
  }
  void hold_next_hub();
  void toggle_valve();

  /// To which pressure the balloon of an instrument is filled, in bar, and how far the sheath of its stent is
  /// drawn back (see HubCouplings).
  void inflate(std::size_t instrument, double bar);
  void draw_sheath(std::size_t instrument, double mm);

  /// Detaches the coil on an instrument's wire, where all of it lies in a sac.
  void detach(std::size_t instrument);

  /// Puts particles into the agent that is injected from now on, or none.
  void mix_in(const Particles& particles) { particles_ = particles; }

  /// Takes one of the choices instead of an instrument, as Instruments::exchange.
  void exchange(std::size_t instrument, std::size_t choice);

  /// Of a body in motion; none where it is still.
  TrainerBody* body() { return body_ ? &*body_ : nullptr; }

  /// So many steps as the hand moves.
  void advance(int steps);

  /// A step towards hubs' poses that are given, as of a script; the hand goes on from there.
  void follow(std::span<const HubPose> poses);

  /// The state, and an exposure of it where one is due; at first without the pedal. Contrast agent flows
  /// until then.
  std::string message();

  const Instruments& instruments() const { return instruments_; }
  const RunMonitor& monitor() const { return monitor_; }

  /// Since this was asked before, of each step: the time in s, and the numbers of each hub's pose.
  std::vector<double> take_steps();

 private:
  void step(std::span<const HubPose> poses);
  void count_step();
  void let_flow();
  void take_vessels();
  std::vector<DeviceTube> devices(std::span<const std::vector<glm::dvec3>> nodes_mm) const;
  bool is_pulse_due();
  bool is_gate_open();
  void expose();

  TrainerSetup setup_;
  std::optional<TrainerBody> body_;
  Instruments instruments_;
  ManualDevice device_{"hand"};
  HubCouplings couplings_;
  ContrastBolus bolus_;
  TipPressures pressures_;
  ContrastSurface contrast_;
  long vessel_changes_ = 0;  ///< that bolus and contrast agent have
  RunMonitor monitor_;
  std::vector<double> poses_;  ///< of the steps that were not taken yet
  TrainerHand hand_;
  Particles particles_;
  std::vector<Embolised> embolised_;     ///< by them
  double told_s_ = 0;                    ///< when the last message was
  double pulses_per_s_ = 0, due_s_ = 0;  ///< 0: at each message; when the next one is
  double pedal_s_ = 0;
  std::optional<double> fluoroscopy_s_, air_kerma_mGy_, dap_Gycm2_;
  long long pulses_ = 0;                ///< exposures with the pedal down
  std::vector<double> exposed_phases_;  ///< of the next exposure
  BrowserMessage message_;
};

}  // namespace xraycast
