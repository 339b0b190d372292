#pragma once

#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/haptics/haptic_device.hpp"
#include "xraycast/haptics/virtual_coupling.hpp"
#include "xraycast/scene/contrast_surface.hpp"
#include "xraycast/scene/scene.hpp"
#include "xraycast/simulation/contrast_bolus.hpp"
#include "xraycast/simulation/simulation_loop.hpp"

#include <deque>
#include <memory>
#include <string>
#include <vector>

namespace xraycast {

/// A catheter steered in real time, as the operator experiences it: its shape and loads, the contrast agent
/// injected through it, and a recording of the hub. All calls on one thread; the simulation has its own,
/// which never waits for it.
class SimulatedRun {
 public:
  /// Throws InputError when the device does not fit into the vessel at the entry.
  SimulatedRun(std::shared_ptr<const VesselTree> tree, const InstrumentModel& model, const VesselEnd& entry,
               std::unique_ptr<HapticDevice> device);

  /// Takes the newest state of the simulation and advances the contrast agent to its time. Call once per
  /// frame.
  void update();

  const CatheterSnapshot& now() const { return *now_; }
  const VesselTree& tree() const { return *tree_; }
  HapticDevice& device() { return *device_; }
  const InstrumentModel& model() const { return model_; }

  /// Injects contrast agent (350 mg iodine per ml) at the tip at this rate from now on; 0 stops.
  void inject(double ml_s) { injection_ml_s_ = ml_s; }
  double injected_ml() const { return injected_ml_; }

  Surface catheter() const;
  Surface contrast() const;

  /// The hub's loads of the last seconds, oldest first.
  struct Load {
    double time_s;
    HubLoad load;
  };
  static constexpr double kKept_s = 10;
  const std::deque<Load>& loads() const { return loads_; }

  /// Records the hub's pose, now and at every update.
  void start_recording();
  bool is_recording() const { return is_recording_; }

  /// Ends the recording with the hub's present pose. Returns a script (see Script) that begins at 0 s.
  std::string stop_recording();

 private:
  struct Pose {
    double time_s;
    HubPose pose;
  };

  std::shared_ptr<const VesselTree> tree_;
  InstrumentModel model_;
  std::unique_ptr<HapticDevice> device_;
  VirtualCoupling coupling_;
  ContrastBolus bolus_;
  ContrastSurface contrast_;
  double injection_ml_s_ = 0, injected_ml_ = 0;
  std::deque<Load> loads_;
  bool is_recording_ = false;
  std::vector<Pose> recorded_;
  SimulationLoop loop_;  ///< last: its thread uses what is above
  const CatheterSnapshot* now_;
};

}  // namespace xraycast
