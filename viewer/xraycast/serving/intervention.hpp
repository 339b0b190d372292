#pragma once

#include "xraycast/haptics/manual_device.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"
#include "xraycast/scene/pulse_blur.hpp"
#include "xraycast/scene/road_map.hpp"
#include "xraycast/scene/session_file.hpp"
#include "xraycast/serving/simulated_run.hpp"

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// A simulated intervention with a C-arm: a catheter, or coaxial instruments, are steered, with fluoroscopy
/// while the pedal is down and last image hold after, and contrast agent is injected. All calls on one
/// thread.
class Intervention {
 public:
  struct Options {
    RunRequest run{};
    std::string haptic = "keyboard";     ///< one of haptic_names(); moves the hubs where no script does
    std::string listen{};                ///< openigtlink: address; empty: the default
    std::optional<Exercise> exercise{};  ///< begins with every run; its instruments alone may be taken
    /// Makes the device at every start, instead of `haptic`.
    std::function<std::unique_ptr<HapticDevice>()> make_device{};
  };

  static std::vector<std::string> haptic_names();

  /// Throws InputError for what cannot be run (see check), an unknown device, a port in use.
  explicit Intervention(const Options& options);

  /// Exposes a picture of the newest state while the pedal is down. Call once per frame.
  void update(const CArmPose& pose, double passed_s);

  SimulatedRun& run() { return *run_; }
  const SimulatedRun& run() const { return *run_; }

  /// Null where a script or a network steers.
  ManualDevice* manual() { return manual_; }
  const ManualDevice* manual() const { return manual_; }
  const std::string& haptic() const { return options_.haptic; }

  void press_pedal(bool is_down) { pedal_ = is_down; }
  bool is_live() const { return pedal_; }
  double fluoroscopy_s() const { return fluoroscopy_s_; }

  /// The C-arm's pose at the last exposure, whose picture is held.
  const CArmPose& pose() const { return pose_; }

  /// The last exposure, as if the C-arm had been there.
  void expose_from(const CArmPose& pose) { pose_ = pose; }

  /// The picture's caption: the C-arm's pose at the last exposure and, where it has moved since, its present
  /// pose.
  std::string caption(const CArmPose& now) const;

  /// The hub that the hand holds, which leads while the valve is locked; the next one from now on. A script
  /// needs no hand.
  std::size_t held_hub() const { return run_->held_hub(); }
  void hold_next_hub();
  void toggle_valve();

  /// Asks for another model instead of an instrument, unless a run is recorded or the instrument is not drawn
  /// back (see Instruments::exchange). Restarts keep it.
  void exchange(std::size_t instrument, const InstrumentModel& model);

  /// Where that was refused, one line that says what to do, as long as it holds; else empty.
  std::string note_on_exchange(std::size_t instrument) const;

  /// Null without one.
  const Exercise* exercise() const { return options_.exercise ? &*options_.exercise : nullptr; }

  /// What a generator of X-rays has used since it was switched on, for the report of the run.
  void count_generator(const RunUse& use) { generator_ = use; }

  /// What an instrument can be exchanged for: the presets, and what the options name; in an exercise what it
  /// allows.
  const std::vector<InstrumentModel>& choices() const { return choices_; }

  /// The instruments and the road map in that picture.
  SteeredInstruments steered() const;

  /// Null where the body is still. Restarts leave it as it is.
  LiveBody* body() { return moving_.body.get(); }
  const LiveBody* body() const { return moving_.body.get(); }

  /// The phases of the body in that picture; none where it is still.
  const std::vector<double>& phases() const { return phases_; }

  /// update() has made an exposure, which with a gate it does when that opens.
  bool has_exposed() const { return has_exposed_; }

  /// How the next exposures see what moves; at first, as if they took no time.
  void blur(const PulseBlur& blur) { blur_ = blur; }

  /// The attenuating surfaces of that picture. They change with `exposures`.
  std::span<const Surface> surfaces() const { return surfaces_; }
  long exposures() const { return exposures_; }

  /// Iodine in that picture, in the drums of the tree's ContrastSurface.
  const std::vector<float>& drums_mg_ml() const { return drums_mg_ml_; }
  /// How far the body has moved them, mm; none where it is still.
  const std::vector<glm::vec3>& drums_moved_mm() const { return drums_moved_mm_; }

  /// A road map is of the vessels as they are in the picture at which it is shown first, and stays there
  /// however the body moves; the first one is of the body as it begins.
  void show_road_map(bool shows);
  bool has_road_map() const { return has_road_map_; }
  /// The vessels' outline in a view, in its pixels.
  std::span<const glm::ivec2> road_map(const View& view);

  /// Starts again at the entry, with the haptic device of the options and the present instruments. A
  /// recording restarts. Throws as the constructor; the run then goes on, or, if only the port is lost, a new
  /// run is steered by keys.
  void restart() { start(options_.run.script, run_->models()); }

  /// Steers these instruments, the present ones by default, by a script, once, from the entry on. Throws
  /// InputError as `restart`.
  void replay(const std::filesystem::path& script) { replay(script, run_->models()); }
  void replay(const std::filesystem::path& script, const std::vector<InstrumentModel>& instruments) {
    start(Script::read(script, instruments.size()), instruments);
  }

 private:
  void start(const std::optional<Script>& script, const std::vector<InstrumentModel>& instruments);
  std::vector<Surface> surfaces_at(double later_s) const;
  std::string exchange_obstacle(std::size_t instrument) const;
  RunUse use() const;

  Options options_;
  SimulatedRun::Moving moving_;
  ManualDevice* manual_ = nullptr;
  std::unique_ptr<SimulatedRun> run_;
  bool pedal_ = false, has_picture_ = false, has_exposed_ = false;
  double fluoroscopy_s_ = 0;
  RunUse generator_, used_before_;  ///< the latter as the run began
  CArmPose pose_;
  std::vector<std::vector<glm::dvec3>> nodes_mm_;  ///< of each instrument
  std::shared_ptr<const std::vector<InstrumentModel>> exposed_;
  std::vector<Surface> surfaces_;
  std::vector<float> drums_mg_ml_;
  std::vector<glm::vec3> drums_moved_mm_;
  std::vector<double> phases_;
  PulseBlur blur_;
  long exposures_ = 0;
  bool has_road_map_ = true;
  RoadMap road_map_;
  std::vector<InstrumentModel> choices_;
  std::optional<std::size_t> refused_;  ///< the instrument that could not be exchanged as it is
};

}  // namespace xraycast
