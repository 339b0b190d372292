#pragma once

#include "xraycast/acquisition/console.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/drawing/grey_picture.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"
#include "xraycast/scene/canvas.hpp"
#include "xraycast/serving/intervention.hpp"
#include "xraycast/window/cine_exporter.hpp"
#include "xraycast/window/drr_comparison.hpp"
#include "xraycast/window/opacity_editor.hpp"
#include "xraycast/window/opened_files.hpp"
#include "xraycast/window/worker.hpp"

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace xraycast {

/// The source of the body's picture: the map, with either compositing, or DRRs of the scan.
enum class BodySource { path, wall, drr };

/// The viewer's state and commands, without the window, the mouse and the panels, which call them. It lives
/// on the thread of the current OpenGL context. Reading, casting and projecting run on other threads; their
/// errors become its message.
class Viewer {
 public:
  /// `device` as for ComputeDevice; `request_redraw` is called on other threads when there is something new
  /// to draw. A map that moves does so as the body, whose motion is the one that the map names if it has
  /// none.
  Viewer(ViewSession session, std::string device, const std::function<void()>& request_redraw,
         BodyRequest body = {});

  // ---- files
  /// Opens files that are shown together, and cancels what is still being opened.
  void open(std::span<const std::filesystem::path> paths);
  void open(const std::filesystem::path& path) { open(std::span(&path, 1)); }
  void cancel();
  void save_session();
  void save_picture();
  void save_cine();

  // ---- the catheter
  /// Steers a catheter from now on, instead of the session's vessels and catheter. Throws as Intervention
  /// does.
  void simulate(const Intervention::Options& options) { intervention_.emplace(options); }
  Intervention* intervention() { return intervention_ ? &*intervention_ : nullptr; }
  const Intervention* intervention() const { return intervention_ ? &*intervention_ : nullptr; }
  void toggle_recording();
  void replay();  ///< the last recording
  bool has_recording() const { return !recording_.empty(); }
  void restart_run();
  /// The run's report, into the file named by keep_report, or the first free xraycast-report-001.html.
  void save_report();
  void keep_report(std::filesystem::path file) { report_ = std::move(file); }
  std::span<const glm::ivec2> road_map(const View& view);

  // ---- the fluoroscope
  /// Takes pictures of the map as a fluoroscope does from now on: one at once, and more while the pedal is
  /// down. Throws as its console does.
  void use_fluoroscope(const FluoroscopyOptions& options);

  /// Off, and on again with its counters; the first time with a fixed C-arm.
  void toggle_console();

  /// Null while it is off.
  FluoroscopyConsole* console() { return console_ && is_console_on_ ? &*console_ : nullptr; }
  const FluoroscopyConsole* console() const { return console_ && is_console_on_ ? &*console_ : nullptr; }

  /// Masks of the phases of a body in motion; see FluoroscopyConsole::match_masks. Without effect where it is
  /// still.
  void match_masks(const std::optional<MaskPhase>& phase);
  bool can_match_masks() const { return body() != nullptr; }

  /// Blends what was opacified into live pictures; the message says where nothing was.
  void toggle_console_road_map();
  void press_pedal(bool is_down);
  bool pedal() const { return pedal_; }

  /// The picture is that of the last exposure, and does not change with what happens since.
  bool is_held() const;

  // ---- the body
  /// Null where it is still.
  LiveBody* body() { return intervention_ ? intervention_->body() : body_.get(); }
  const LiveBody* body() const { return intervention_ ? intervention_->body() : body_.get(); }
  bool is_moving()
      const;  ///< the picture, or what a monitor shows of the body, differs from the last frame's

  // ---- the vessels
  /// The tree of the folder of vessels, or that in which the catheter is steered; none: there is only a
  /// surface.
  const VesselTree* tree() const;

  /// Picks the vessel at a position in a window of that size, in pixels from its upper left corner.
  void pick(const glm::dvec2& position, float width, float height);
  const std::optional<VesselTree::Location>& picked() const { return picked_; }

  // ---- how it is shown
  ViewSession& session() { return session_; }
  CArmPose& pose() { return session_.pose; }
  const CArmPose& pose() const { return session_.pose; }
  std::string caption() const;  ///< of the picture
  void reset_view();            ///< the whole body or, with a fluoroscope, all of its field
  Style& style() { return session_.style; }
  BodySource source() const;
  void set_source(BodySource source);
  void next_source();
  void set_look(Look look);
  bool is_rotating = false;  ///< the C-arm, as a cine loop
  bool is_split = false;     ///< a DRR beside the map
  bool shows_help = false, shows_panels = true;
  bool shows_first_steps = false;  ///< until the first key
  bool follows = true;             ///< the table follows the tip of the instrument in the hand as it moves

  /// Opacity and layers, with undo. `attempt` handles its errors.
  OpacityEditor& opacity() { return opacity_; }

  // ---- what there is
  const BodyMap* map() const { return shown_.get(); }
  bool has_scan() const { return opened_.scan != nullptr; }
  const BodyBounds& bounds() const { return bounds_; }
  View view_in(int width, int height) const;
  const std::string& message() const { return message_; }
  void clear_message() { message_.clear(); }
  std::optional<Worker::Status> status() const;
  bool is_animating() const;  ///< every frame differs from the last
  std::optional<double> psnr_db() const { return drrs_.psnr_db(); }
  std::size_t texture_B() const { return renderer_.texture_B(); }
  double frame_ms() const { return frame_ms_; }

  /// A part of the framebuffer that shows one view, from its lower left corner on.
  struct Pane {
    int x, y, width, height;
    bool is_drr;
  };
  std::vector<Pane> panes(int width, int height) const;

  /// The view that a pane shows, which is that of the last exposure with a fluoroscope, in the pane's pixels.
  View shown_in(const Pane& pane) const;

  /// Keeps the right and the lower edge of the window for what is beside the picture, in pixels.
  void reserve(int right, int below) {
    reserved_right_ = right;
    reserved_below_ = below;
  }

  /// Takes the workers' results and draws the picture on the default framebuffer. Throws as open_files if the
  /// viewer's first session cannot be opened.
  void draw(int width, int height);

  /// Errors become the message. Returns whether there was none.
  bool attempt(const std::function<void()>& action);

 private:
  void load(ViewSession wanted, bool takes_view);
  void deliver(OpenedFiles opened, bool takes_view);
  void show_map(std::shared_ptr<const BodyMap> map);
  void draw_pane(const Pane& pane);
  void draw_drr(const Pane& pane);
  void draw_fluoroscopy(const Pane& pane);
  static PixelBox box_in(const Pane& pane, const View& view);
  void fit_field(const Pane& pane);
  void follow_tip(const Pane& pane);
  glm::dvec2 field_mm() const;
  std::vector<std::uint8_t> annotated_picture(const Pane& pane);
  void take_results();
  void export_cine_frame();
  void show_catheter();
  PulseBlur blur_of(const Pane& pane) const;
  void begin_body();
  void begin_at(const std::map<std::string, double>& instant);
  void pass_time(double passed_s);
  void show_body(std::span<const double> phases);
  std::vector<double> phases_of_picture() const;
  void adapt_brightness(const View& view);
  const CArmPose& picture_pose() const;
  bool is_fluoroscopy(const Pane& pane) const { return console() && !pane.is_drr; }

  ViewSession session_;
  std::string device_;
  Renderer renderer_;
  OpenedFiles opened_;
  OpacityEditor opacity_{session_};
  std::shared_ptr<const BodyMap> shown_;  ///< the editor's, as the renderer has it
  std::optional<WaterPath> water_path_;   ///< of the shown map, once it was needed
  BodyBounds bounds_;
  BodyRequest body_request_;
  std::optional<MaskPhase> mask_phase_;
  std::unique_ptr<LiveBody> body_;  ///< of a map that moves where no catheter is steered
  std::vector<double> exposed_phases_;
  std::vector<glm::vec3> vessel_points_mm_;
  bool is_gate_open_ = true;
  double cine_begin_s_ = 0;
  bool shows_drr_ = false;
  bool is_first_ = true;  ///< no other session than the constructor's was opened yet

  std::string message_;
  DrrComparison drrs_;
  std::optional<CineExporter> cine_;
  std::optional<Intervention> intervention_;
  std::optional<RoadMap> road_map_;  ///< of a session whose catheter was steered
  std::optional<FluoroscopyConsole> console_;
  bool is_console_on_ = true, fits_field_ = false, pedal_ = false, is_pulse_due_ = false;
  bool lacks_picture_ = false;  ///< the fluoroscope has none of this body and run, and needs no pedal for it
  GreyPicture held_;            ///< the fluoroscope's last image
  CArmPose exposed_from_;       ///< at that image
  glm::dvec3 followed_mm_{0};   ///< the tip that the table has followed last
  double followed_zoom_ = 0;
  Stopwatch since_frame_;
  long shown_exposures_ = -1;
  std::size_t shown_surfaces_ = 0;  ///< of the last exposure
  std::optional<VesselTree::Location> picked_;
  std::optional<View> adapted_to_;  ///< the view that the grey window was chosen for
  std::filesystem::path recording_, report_;
  std::optional<std::string> graded_report_;  ///< of the run before its replay, which is nobody's work
  std::vector<InstrumentModel> recorded_;     ///< the instruments of that recording
  int width_ = 0, height_ = 0;                ///< of the last frame
  int reserved_right_ = 0, reserved_below_ = 0;
  double frame_ms_ = 0;

  Worker opening_, writing_;
};

}  // namespace xraycast
