#pragma once

#include "xraycast/catheter/hub.hpp"
#include "xraycast/contrast_agent/contrast_bolus.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/haptics/haptic_device.hpp"
#include "xraycast/haptics/hub_couplings.hpp"
#include "xraycast/motion/moving_points.hpp"
#include "xraycast/scene/contrast_surface.hpp"
#include "xraycast/scene/device_tubes.hpp"
#include "xraycast/scene/scene.hpp"
#include "xraycast/serving/live_body.hpp"
#include "xraycast/serving/live_monitor.hpp"
#include "xraycast/simulation/instrument_pressures.hpp"
#include "xraycast/simulation/run.hpp"
#include "xraycast/simulation/simulation_loop.hpp"

#include <array>
#include <deque>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace xraycast {

TreatingView treating_view(const InstrumentSnapshot& instrument);

/// A catheter, or coaxial instruments, steered in real time, as the operator experiences it: shapes and
/// loads, the contrast agent injected through them, and a recording of the hubs. All calls on one thread; the
/// simulation has its own, which never waits for it.
class SimulatedRun {
 public:
  /// What moves about the instruments: the body, whose clock the run advances, and the points of the tree's
  /// ContrastSurface in it.
  struct Moving {
    std::shared_ptr<LiveBody> body;
    std::shared_ptr<const MovingPoints> contrast;

    /// Of a request; nothing where it has no motion.
    static Moving of(const RunRequest& request);
  };

  /// The device moves the hubs, whatever the request's script. Throws InputError where the instruments do not
  /// fit into the vessel at the entry or into each other.
  SimulatedRun(const RunRequest& request, std::unique_ptr<HapticDevice> device)
      : SimulatedRun(request, std::move(device), Moving::of(request)) {}

  /// The same in a body that goes on from where it is, and with an exercise, as it begins.
  SimulatedRun(const RunRequest& request, std::unique_ptr<HapticDevice> device, Moving moving,
               const std::optional<Exercise>& exercise = {});

  /// Takes the newest state of the simulation and advances the contrast agent to its time. Call once per
  /// frame.
  void update();

  const CatheterSnapshot& now() const { return *now_; }
  const VesselTree& tree() const { return *tree_; }
  /// The same as balloons and stents have left it so far.
  VesselTree treated_tree() const { return treated_ ? treated_->walls.widened(*tree_) : *tree_; }
  HapticDevice& device() { return *device_; }
  std::size_t held_hub() const { return device_->held(); }
  const std::vector<InstrumentModel>& models() const { return *now_->instruments; }  ///< at that time

  /// Asks for another model instead of an instrument; now() says at a later update whether it was made. See
  /// SimulationLoop::exchange.
  void exchange(std::size_t instrument, const InstrumentModel& model) { loop_.exchange(instrument, model); }

  /// Several instruments are steered by a hand, not by a script.
  bool has_valve() const { return now_->count() > 1 && !device_->is_rigid(); }
  /// Clamps the instruments together, or releases them; see HubCouplings.
  void lock_valve(bool is_locked) { couplings_.lock(is_locked); }
  bool is_valve_locked() const { return couplings_.is_locked(); }

  /// Injects contrast agent (350 mg iodine per ml) at this rate from now on, through the outermost free
  /// lumen; 0 stops. See agent_outlet.
  void inject(double ml_s) { injection_ml_s_ = ml_s; }
  double injection_ml_s() const { return injection_ml_s_; }
  double injected_ml() const { return injected_ml_; }

  /// Puts particles into the agent that is injected from now on, or none.
  void mix_in(const Particles& particles) { particles_ = particles; }
  const Particles& particles() const { return particles_; }
  /// Where particles have gone.
  std::vector<Embolised> embolised() const { return bolus_.flow().embolisation().list(); }

  /// Fills the balloon of an instrument, or folds it: the pressure to which it goes, up to what it bears, by
  /// at most MovingHub::kMaxInflation_bar_s. See HubCouplings.
  void inflate(std::size_t instrument, double bar) { couplings_.inflate(instrument, bar); }
  double inflation_bar(std::size_t instrument) const { return couplings_.inflation_bar(instrument); }

  /// Draws the sheath of an instrument's stent back, by at most MovingHub::kMaxRelease_mm_s. See
  /// HubCouplings.
  void draw_sheath(std::size_t instrument, double mm) { couplings_.draw_sheath(instrument, mm); }
  double sheath_mm(std::size_t instrument) const { return couplings_.sheath_mm(instrument); }

  /// Detaches the coil on an instrument's wire, where all of it lies in a sac.
  void detach(std::size_t instrument) { couplings_.detach_next(instrument); }

  /// What is counted of the run.
  LiveMonitor& monitor() { return monitor_; }
  const LiveMonitor& monitor() const { return monitor_; }

  /// Now, or so much later as they go on; with the stents that were left.
  std::vector<Surface> instruments(double later_s = 0) const;
  Surface contrast(double later_s = 0) const;
  /// Now: balloons, stents on them or in sheaths, and those that were left.
  std::vector<DeviceTube> devices() const;

  /// Null where the body is still.
  const std::shared_ptr<LiveBody>& body() const { return moving_.body; }
  std::vector<float> drums_mg_ml() const { return contrast_.drums_mg_ml(bolus_.iodine_mg_ml()); }
  std::vector<glm::vec2> drums_mm() const { return contrast_.radii_mm(); }
  /// None where the body is still.
  std::vector<glm::vec3> drums_moved_mm() const;

  /// The blood's pressures now and over the last heartbeat.
  const TipPressures& pressures() const { return pressures_; }

  /// The hubs' loads, and those pressures, of the last seconds, oldest first.
  struct Load {
    double time_s;
    std::array<HubLoad, kMaxHubs> hubs;
    std::array<double, kMaxHubs> tips_mmHg;  ///< the blood's pressure at each tip
  };
  static constexpr double kKept_s = 10;
  const std::deque<Load>& loads() const { return loads_; }

  /// Records the hubs' poses, now and at every update. A recording is of the same instruments throughout.
  void start_recording();
  bool is_recording() const { return is_recording_; }

  /// Ends the recording with the hubs' present poses. Returns a script (see Script) that begins at 0 s.
  std::string stop_recording();

 private:
  void take_vessels();
  bool has_attached_coil() const;
  void take_coils();
  std::vector<DeviceTube> moved_coils() const;
  std::vector<DeviceTube> moved_stents() const;
  struct Poses {
    double time_s;
    std::array<HubPose, kMaxHubs> hubs;
  };
  void record();
  std::vector<TreeFlow::Filling> fillings() const;
  std::vector<glm::dvec3> nodes_of(std::size_t instrument, double later_s) const;

  std::shared_ptr<const VesselTree> tree_;
  std::unique_ptr<HapticDevice> device_;
  VesselEnd entry_;
  HubCouplings couplings_;
  ContrastBolus bolus_;
  ContrastSurface contrast_;
  Moving moving_;
  std::shared_ptr<const Motion> motion_;                  ///< none: the body is still
  std::shared_ptr<const TreatedVessels> treated_;         ///< that contrast agent and stents are of
  std::vector<DeviceTube> stents_;                        ///< in the scan
  std::vector<Surface> stent_surfaces_;                   ///< of each, where the body is still
  std::shared_ptr<const std::vector<CoiledSac>> coiled_;  ///< that contrast agent and coils are of
  std::vector<DeviceTube> coils_;                         ///< in the scan
  std::vector<Surface> coil_surfaces_;                    ///< of each, where the body is still
  std::vector<MovingPoints> stent_points_;                ///< of each, where it moves
  double body_from_s_;                                    ///< the body's time as the run begins
  double injection_ml_s_ = 0, injected_ml_ = 0;
  Particles particles_;
  TipPressures pressures_;
  std::deque<Load> loads_;
  bool is_recording_ = false;
  std::vector<Poses> recorded_;
  std::shared_ptr<const std::vector<InstrumentModel>> recorded_of_;
  LiveMonitor monitor_;
  SimulationLoop loop_;  ///< last: its thread uses what is above
  const CatheterSnapshot* now_;
  std::vector<std::vector<glm::dvec3>> before_mm_;  ///< the instruments' nodes at the update before
  double passed_s_ = 0;                             ///< since then
};

}  // namespace xraycast
