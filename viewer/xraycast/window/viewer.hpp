#pragma once

#include "xraycast/base/stopwatch.hpp"
#include "xraycast/casting/projector.hpp"
#include "xraycast/drawing/cine_writer.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/sampling/camera.hpp"
#include "xraycast/window/intervention.hpp"
#include "xraycast/window/latest_worker.hpp"
#include "xraycast/window/opacity_panel.hpp"
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

/// What pictures of the body are made from: the map, in either way, or the scan itself.
enum class BodySource { path, wall, truth };

/// What the viewer shows and what can be done with it, without the window, the mouse and the panels: these
/// call its verbs. It lives on the thread of the current OpenGL context. Reading, casting and true
/// projections are done beside it; what goes wrong becomes its message.
class Viewer {
 public:
  /// `device` as for ComputeDevice; `wake` is called on other threads when there is something new to draw.
  Viewer(ViewSession session, std::string device, const std::function<void()>& wake);

  // ---- files
  void open(const std::filesystem::path& path);
  void cancel();
  void save_session();
  void save_picture();
  void save_cine();

  // ---- the catheter
  /// Steers a catheter from here on, in the place of the session's vessels and catheter. Throws as
  /// Intervention does.
  void simulate(const Intervention::Options& options) { intervention_.emplace(options); }
  Intervention* intervention() { return intervention_ ? &*intervention_ : nullptr; }
  const Intervention* intervention() const { return intervention_ ? &*intervention_ : nullptr; }
  void toggle_recording();
  void replay();  ///< the last recording
  void restart_run();
  std::span<const glm::ivec2> road_map(const View& view);

  // ---- the vessels
  /// Of the folder of vessels, or that in which the catheter is steered; none: there is just a surface.
  const VesselTree* tree() const;

  /// Looks for a vessel at a place of a window of that size, in pixels from its upper left corner.
  void pick(const glm::dvec2& place, float width, float height);
  const std::optional<VesselTree::Location>& picked() const { return picked_; }

  // ---- how it is shown
  ViewSession& session() { return session_; }
  Camera& camera() { return session_.camera; }
  const Camera& camera() const { return session_.camera; }
  std::string caption() const;  ///< of the picture
  Style& style() { return session_.style; }
  BodySource drawing() const;
  void set_drawing(BodySource drawing);
  void next_drawing();
  void set_shading_mode(ShadingMode shading);
  void toggle_layer(std::size_t layer);
  bool turns = false;   ///< cine rotation
  bool splits = false;  ///< the true projection beside the map
  bool help = false;

  // ---- the opacity
  bool can_recast() const { return opened_.recast != nullptr; }
  std::span<const double> knots_hu() const;
  std::span<const double> mu_per_mm() const { return mu_per_mm_; }
  std::span<const std::int64_t> hu_histogram() const;
  void set_opacity(std::span<const double> mu_per_mm);

  /// To be called before opacity or layers change.
  void remember();
  void undo() { step(undo_, redo_); }
  void redo() { step(redo_, undo_); }

  // ---- what there is
  const BodyMap* map() const { return shown_.get(); }
  bool has_scan() const { return opened_.scan != nullptr; }
  const BodyBounds& bounds() const { return bounds_; }
  View view_in(int width, int height) const;
  const std::string& message() const { return message_; }
  std::optional<Worker::Status> status() const;
  bool is_busy() const;  ///< every frame is another one
  std::optional<double> psnr_db() const { return psnr_db_; }
  std::size_t texture_B() const { return renderer_.texture_B(); }
  double frame_ms() const { return frame_ms_; }

  /// A part of the framebuffer that shows one view, from its lower left corner on.
  struct Pane {
    int x, width, height;
    bool is_truth;
  };
  std::vector<Pane> panes(int width, int height) const;

  /// Takes in what workers have done and draws the picture on the bound framebuffer. Throws as open_files
  /// where the session that the viewer was made with cannot be opened.
  void draw(int width, int height);

  /// Errors become the message.
  void attempt(const std::function<void()>& action);

 private:
  struct TruthRequest {
    View view;
    Opacity opacity;
    std::shared_ptr<OpenedFiles::ScanOnDevice> scan;
  };
  struct LikenessRequest {
    std::vector<float> tau;
    std::shared_ptr<const ProjectionImage> truth;
  };
  struct Edit {  ///< of what can be undone
    std::optional<Opacity> opacity;
    std::vector<float> layer_weights;
  };
  struct Cine {
    CineWriter pictures, animation;
    std::filesystem::path folder;
    Camera camera;
    int frame = 0;
  };

  void load(ViewSession wanted, bool takes_view);
  void deliver(OpenedFiles opened, bool takes_view);
  void use_map(std::shared_ptr<const BodyMap> map);
  void step(std::vector<Edit>& from, std::vector<Edit>& to);
  void draw_truth(const Pane& pane);
  void take_results();
  void next_cine_frame();
  void show_catheter();
  void adapt_brightness(const View& view);
  const Camera& picture_camera() const;

  ViewSession session_;
  std::string device_;
  Renderer renderer_;
  OpenedFiles opened_;
  std::shared_ptr<const BodyMap> shown_;  ///< the opened map, or as it was recast
  std::vector<double> mu_per_mm_;         ///< at the basis' knots
  BodyBounds bounds_;
  bool truth_ = false;
  bool is_first_ = true;  ///< nothing but the session that the viewer was made with was to be opened yet

  std::vector<Edit> undo_, redo_;
  std::string message_;
  std::shared_ptr<const ProjectionImage> latest_truth_;
  std::optional<View> asked_view_;
  std::optional<Opacity> asked_opacity_;
  std::optional<double> psnr_db_;
  std::optional<Cine> cine_;
  std::optional<Intervention> intervention_;
  std::optional<RoadMap> road_map_;  ///< of a session whose catheter was steered
  Stopwatch since_frame_;
  long shown_exposures_ = -1;
  std::optional<VesselTree::Location> picked_;
  std::optional<View> adapted_to_;  ///< the view that the grey window was chosen for
  std::filesystem::path recording_;
  int width_ = 0, height_ = 0;  ///< of the last frame
  double frame_ms_ = 0;

  Worker opening_, writing_;
  LatestWorker<TruthRequest, std::shared_ptr<const ProjectionImage>> projecting_;
  LatestWorker<LikenessRequest, double> comparing_;
};

}  // namespace xraycast
