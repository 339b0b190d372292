#include "xraycast/window/viewer.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/png_file.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/casting/comparison.hpp"
#include "xraycast/drawing/brightness.hpp"
#include "xraycast/scene/annotations.hpp"
#include "xraycast/scene/vessel_pick.hpp"
#include "xraycast/scene/vessels.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <epoxy/gl.h>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

constexpr int kCineFrames = 72, kCineWidth = 640, kCineHeight = 480;

/// `xraycast-001.png`, or the first number that is free.
fs::path unused(const std::string& stem, const std::string& extension) {
  fs::path path;
  for (int number = 1; path.empty() || fs::exists(path); ++number)
    path = fmt::format("{}-{:03}{}", stem, number, extension);
  return path;
}

/// A view's picture with letters and scale.
void furnish(std::span<std::uint8_t> rgb, const View& view, const BodyBounds& bounds,
             const std::string& caption) {
  const glm::dvec3 half(0, 0, bounds.half_height_mm);
  draw_annotations(rgb, view, annotations_of(view, bounds.centre_mm + half, bounds.centre_mm - half),
                   caption);
}

bool is_vessels(const fs::path& path) {
  const std::string extension = extension_of(path);
  return extension == ".vtp" || extension == ".stl" || fs::exists(path / "surface.vtp") ||
         fs::exists(path / "surface.stl") || fs::exists(path / "tree.vtp");
}

/// The session with another file, or another session.
ViewSession with_file(ViewSession session, const fs::path& path) {
  const std::string extension = extension_of(path);
  if (extension == ".json") return read_session(path);
  if (extension == ".basis") {
    session.basis = path;
  } else if (extension == ".csv") {
    session.catheter = path;
    session.steered.reset();
  } else if (is_vessels(path)) {
    session.vessels = path;
    session.steered.reset();
  } else {
    session.map.clear();
    session.basis.clear();
    session.scan.clear();
    session.opacity.reset();
    session.has_window = false;
    (extension == ".exr" ? session.map : session.scan) = path;
  }
  return session;
}

}  // namespace

Viewer::Viewer(ViewSession session, std::string device, const std::function<void()>& wake)
    : device_(std::move(device)),
      projecting_(
          [](const TruthRequest& request) {
            Progress progress;
            return std::make_shared<const ProjectionImage>(
                project(*request.scan->scan, request.view, request.opacity, progress));
          },
          wake),
      comparing_(
          [](const LikenessRequest& request) {
            const View& view = request.truth->view;
            const std::vector<std::uint8_t> all(request.tau.size(), 1);
            return compare(request.tau, request.truth->tau, all, view.width, view.height).psnr_db;
          },
          wake) {
  load(std::move(session), true);
}

void Viewer::attempt(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::bad_alloc&) {
    message_ = "not enough memory";
  } catch (const std::exception& error) {
    message_ = error.what();
  }
}

// ---- files ----------------------------------------------------------------------------------------

void Viewer::load(ViewSession wanted, bool takes_view) {
  wanted.style.pixels_per_column = 2;
  opening_.start("Opening",
                 [this, wanted = std::move(wanted), before = opened_,
                  takes_view](Progress& progress) -> Worker::Delivery {
                   const auto opened =
                       std::make_shared<OpenedFiles>(open_files(wanted, before, device_, progress));
                   return [this, opened, takes_view] { deliver(std::move(*opened), takes_view); };
                 });
}

/// Only what could be opened becomes part of the session.
void Viewer::deliver(OpenedFiles opened, bool takes_view) {
  is_first_ = false;
  const bool is_other_map = opened.map != opened_.map || opened.recast != opened_.recast;
  opened_ = std::move(opened);
  const Camera camera = session_.camera;
  const Style style = session_.style;
  session_ = opened_.session;
  if (!takes_view) {  // which may have been changed in the meantime
    session_.camera = camera;
    session_.style = style;
  }
  road_map_.reset();
  latest_truth_.reset();
  asked_view_.reset();
  std::vector<Surface> surfaces;
  for (const auto& surface : {opened_.vessels, opened_.catheter})
    if (surface && !intervention_) surfaces.push_back(*surface);
  renderer_.set_surfaces(surfaces);
  shown_exposures_ = -1;
  adapted_to_.reset();
  picked_.reset();
  if (!opened_.map) return;
  if (opened_.vessels)
    for (const std::string& note : notes_on_place(
             opened_.vessels->mesh.points_mm, bounds_of(opened_.map->geometry), session_.vessels.string()))
      message_ = note;
  if (is_other_map) {
    undo_.clear();
    redo_.clear();
    use_map(opened_.map);
  }
  if (!opened_.recast) return;
  const Opacity start = session_.opacity.value_or(opened_.map->opacity);
  mu_per_mm_.clear();
  for (const double hu : knots_hu()) mu_per_mm_.push_back(start.mu_per_mm(hu));
  if (session_.opacity) set_opacity(mu_per_mm_);
}

void Viewer::open(const fs::path& path) {
  attempt([&] {
    if (!fs::exists(path)) throw InputError("{}: no such file or folder", path.string());
    message_.clear();
    is_first_ = false;
    load(with_file(session_, path), extension_of(path) == ".json");
  });
}

void Viewer::save_session() {
  attempt([&] {
    const fs::path path = "xraycast-session.json";
    ViewSession shown = session_;
    shown.camera = picture_camera();
    if (intervention_) shown.steered = intervention_->catheter();
    write_session(shown, path);
    message_ = "saved " + fs::absolute(path).string();
  });
}

void Viewer::save_picture() {
  attempt([&] {
    if (!shown_) throw InputError("there is no picture to save yet");
    const int width = width_, height = height_;
    std::vector<std::uint8_t> rgb(static_cast<std::size_t>(3) * width * height);
    for (const Pane& pane : panes(width, height)) {
      const View view = view_in(pane.width, pane.height);
      const bool is_truth = pane.is_truth && latest_truth_;
      std::vector<std::uint8_t> part = is_truth ? renderer_.picture(*latest_truth_, session_.style)
                                                : renderer_.picture(view, session_.style);
      const View& drawn = is_truth ? latest_truth_->view : view;
      furnish(part, drawn, bounds_, status_of(picture_camera()));
      draw_outline(road_map(drawn), kRoadMapColour, drawn.width, part);
      const std::size_t row = std::size_t{3} * drawn.width;
      for (int j = 0; j < std::min(height, drawn.height); ++j)
        std::copy_n(&part[j * row], std::min(row, std::size_t{3} * pane.width),
                    &rgb[3 * (static_cast<std::size_t>(j) * width + pane.x)]);
    }
    const fs::path path = unused("xraycast", ".png");
    message_ = "saved " + fs::absolute(path).string();
    writing_.start("Saving", [rgb = std::move(rgb), width, height, path](Progress&) -> Worker::Delivery {
      write_png(rgb, width, height, 3, path);
      return {};
    });
  });
}

void Viewer::save_cine() {
  attempt([&] {
    if (!shown_) throw InputError("there is no picture to save yet");
    const fs::path folder = unused("xraycast-cine", "");
    fs::create_directories(folder);
    cine_.emplace(Cine{CineWriter(folder, kCineWidth, kCineHeight),
                       CineWriter(folder / "turn.gif", kCineWidth, kCineHeight), folder, session_.camera});
  });
}

void Viewer::next_cine_frame() {
  const View view = view_of(cine_->camera, bounds_, kCineWidth, kCineHeight);
  std::vector<std::uint8_t> rgb = renderer_.picture(view, session_.style);
  furnish(rgb, view, bounds_, status_of(cine_->camera));
  cine_->pictures.add(rgb);
  cine_->animation.add(rgb);
  cine_->camera.rotate(360.0 / kCineFrames);
  if (++cine_->frame < kCineFrames) return;
  cine_->animation.finish();
  message_ = fmt::format("saved {} frames in {}", kCineFrames, fs::absolute(cine_->folder).string());
  cine_.reset();
}

void Viewer::cancel() {
  if (!status()) return;
  opening_.cancel();
  cine_.reset();
  message_ = "cancelled";
}

bool Viewer::is_busy() const { return turns || cine_; }

std::optional<Worker::Status> Viewer::status() const {
  if (cine_) return Worker::Status{"Cine", "drawing", static_cast<double>(cine_->frame) / kCineFrames};
  return opening_.status();
}

// ---- the catheter ---------------------------------------------------------------------------------

/// What the last exposure saw of it.
void Viewer::show_catheter() {
  intervention_->update(session_.camera, since_frame_.ms() / 1000);
  if (intervention_->exposures() == shown_exposures_) return;
  shown_exposures_ = intervention_->exposures();
  for (std::size_t i = 0; i < intervention_->surfaces().size(); ++i)
    renderer_.replace_surface(i, intervention_->surfaces()[i]);
}

void Viewer::toggle_recording() {
  attempt([&] {
    SimulatedRun& run = intervention_->run();
    if (!run.is_recording()) return run.start_recording();
    recording_ = unused("xraycast-run", ".csv");
    write_whole_file(recording_, run.stop_recording());
    message_ = "saved " + fs::absolute(recording_).string();
  });
}

void Viewer::replay() {
  attempt([&] {
    if (recording_.empty())
      throw InputError("there is no recording yet; press Record, and once more to end it");
    intervention_->replay(recording_);
  });
}

void Viewer::restart_run() {
  attempt([&] { intervention_->restart(); });
}

std::span<const glm::ivec2> Viewer::road_map(const View& view) {
  if (intervention_) return intervention_->road_map(view);
  if (!session_.steered || !session_.steered->has_road_map || !opened_.tree) return {};
  if (!road_map_) road_map_.emplace(*opened_.tree);
  return road_map_->outline(view);
}

// ---- the vessels ----------------------------------------------------------------------------------

const VesselTree* Viewer::tree() const {
  return intervention_ ? &intervention_->run().tree() : opened_.tree.get();
}

void Viewer::pick(const glm::dvec2& place, float width, float height) {
  picked_.reset();
  if (!tree() || !shown_) return;
  for (const Pane& pane : panes(static_cast<int>(width), static_cast<int>(height)))
    if (place.x >= pane.x && place.x < pane.x + pane.width)
      picked_ = vessel_at(*tree(), view_in(pane.width, pane.height), place - glm::dvec2(pane.x, 0));
}

// ---- how it is shown ------------------------------------------------------------------------------

Drawing Viewer::drawing() const {
  if (truth_ && has_scan()) return Drawing::truth;
  return session_.style.sampling.compositing == Compositing::path ? Drawing::path : Drawing::wall;
}

void Viewer::set_drawing(Drawing drawing) {
  truth_ = drawing == Drawing::truth && has_scan();
  session_.style.sampling.compositing = drawing == Drawing::wall ? Compositing::wall : Compositing::path;
}

void Viewer::next_drawing() {
  switch (drawing()) {
    case Drawing::path:
      return set_drawing(Drawing::wall);
    case Drawing::wall:
      return set_drawing(has_scan() ? Drawing::truth : Drawing::path);
    case Drawing::truth:
      return set_drawing(Drawing::path);
  }
}

void Viewer::set_look(Look look) {
  session_.style.look = look;
  session_.style.window.inverted = look == Look::surface;
}

void Viewer::toggle_layer(std::size_t layer) {
  std::vector<float>& strengths = session_.style.strengths;
  if (layer >= strengths.size()) return;
  remember();
  strengths[layer] = strengths[layer] > 0 ? 0.0f : 1.0f;
}

void Viewer::use_map(std::shared_ptr<const BodyMap> map) {
  if (!shown_ || shown_->geometry != map->geometry) adapted_to_.reset();
  shown_ = std::move(map);
  renderer_.set_map(shown_);
  bounds_ = bounds_of(shown_->geometry);
  Style& style = session_.style;
  const auto layers = static_cast<std::size_t>(shown_->geometry.layers());
  if (style.strengths.size() != layers) style.strengths.assign(layers, 1.0f);
}

// ---- the opacity ----------------------------------------------------------------------------------

std::span<const double> Viewer::knots_hu() const {
  if (!opened_.recast) return {};
  return opened_.recast->basis.knots_hu;
}

std::span<const std::int64_t> Viewer::hu_histogram() const {
  if (!opened_.recast) return {};
  return opened_.recast->basis.hu_histogram;
}

void Viewer::set_opacity(std::span<const double> mu_per_mm) {
  if (!opened_.recast) return;
  std::vector<Opacity::Knot> knots;
  for (std::size_t i = 0; i < mu_per_mm.size(); ++i) knots.push_back({knots_hu()[i], mu_per_mm[i]});
  session_.opacity = Opacity("edited", std::move(knots));
  mu_per_mm_.assign(mu_per_mm.begin(), mu_per_mm.end());
  use_map(std::make_shared<BodyMap>(opened_.recast->session.recast(*session_.opacity)));
}

void Viewer::remember() {
  undo_.push_back({session_.opacity, session_.style.strengths});
  redo_.clear();
}

void Viewer::step(std::vector<Edit>& from, std::vector<Edit>& to) {
  if (from.empty()) return;
  Edit edit = std::move(from.back());
  from.pop_back();
  to.push_back({session_.opacity, session_.style.strengths});
  session_.style.strengths = std::move(edit.strengths);
  if (!opened_.recast || edit.opacity == session_.opacity) return;
  const Opacity& opacity = edit.opacity ? *edit.opacity : opened_.map->opacity;
  std::vector<double> mu;
  for (const double hu : knots_hu()) mu.push_back(opacity.mu_per_mm(hu));
  if (edit.opacity) return attempt([&] { set_opacity(mu); });
  mu_per_mm_ = std::move(mu);
  session_.opacity.reset();
  use_map(opened_.map);
}

// ---- the picture ----------------------------------------------------------------------------------

const Camera& Viewer::picture_camera() const {
  return intervention_ ? intervention_->camera() : session_.camera;
}

std::string Viewer::caption() const {
  return intervention_ ? intervention_->caption(session_.camera) : status_of(session_.camera);
}

View Viewer::view_in(int width, int height) const {
  return view_of(picture_camera(), bounds_, std::max(1, width), std::max(1, height));
}

std::vector<Viewer::Pane> Viewer::panes(int width, int height) const {
  const bool is_truth = drawing() == Drawing::truth;
  if (!splits || !has_scan() || width < 2) return {{0, width, height, is_truth}};
  const int half = width / 2;
  return {{0, half, height, false}, {half, width - half, height, true}};
}

/// The latest picture that was made; the next is asked for when something has changed.
void Viewer::draw_truth(const Pane& pane) {
  const View view = view_in(pane.width, pane.height);
  const Opacity& opacity = session_.opacity ? *session_.opacity : shown_->opacity;
  if (asked_view_ != view || asked_opacity_ != opacity) {
    projecting_.ask({view, opacity, opened_.scan});
    asked_view_ = view;
    asked_opacity_ = opacity;
  }
  if (!latest_truth_) return;
  const View& drawn = latest_truth_->view;
  if (drawn.width == pane.width && drawn.height == pane.height)
    renderer_.draw(*latest_truth_, session_.style, pane.x, 0);
}

/// The grey window follows the C-arm and the table, until one is chosen by hand. What moves or is edited in a
/// view that stays does not change it.
void Viewer::adapt_brightness(const View& view) {
  if (session_.has_window) return adapted_to_.reset();
  if (adapted_to_ == view) return;
  session_.style.window = automatic_window(renderer_, view, session_.style);
  adapted_to_ = view;
}

void Viewer::take_results() {
  if (is_first_)
    opening_.poll();
  else
    attempt([&] { opening_.poll(); });
  attempt([&] { writing_.poll(); });
  attempt([&] {
    if (const auto psnr = comparing_.take()) psnr_db_ = *psnr;
    auto truth = projecting_.take();
    if (!truth) return;
    latest_truth_ = std::move(*truth);
    if (!splits || !shown_) return;
    comparing_.ask({renderer_.body_tau(latest_truth_->view, session_.style), latest_truth_});
  });
}

void Viewer::draw(int width, int height) {
  take_results();
  width_ = width;
  height_ = height;
  const Stopwatch stopwatch;
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  glClearColor(0.05f, 0.05f, 0.06f, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  if (!shown_ || width <= 0 || height <= 0) return;
  if (turns) session_.camera.rotate(360.0 / kCineFrames / 2);
  if (intervention_) attempt([&] { show_catheter(); });
  since_frame_ = {};
  if (cine_) attempt([&] { next_cine_frame(); });
  attempt([&] {
    const Pane first = panes(width, height).front();
    adapt_brightness(view_in(first.width, first.height));
    for (const Pane& pane : panes(width, height)) {
      glBindFramebuffer(GL_FRAMEBUFFER, 0);
      glViewport(pane.x, 0, pane.width, pane.height);
      if (pane.is_truth)
        draw_truth(pane);
      else
        renderer_.draw(view_in(pane.width, pane.height), session_.style, pane.x, 0);
    }
  });
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  glViewport(0, 0, width, height);
  glFinish();
  frame_ms_ = stopwatch.ms();
}

}  // namespace xraycast
