#include "xraycast/window/viewer.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/casting/key_maps.hpp"
#include "xraycast/drawing/brightness.hpp"
#include "xraycast/fluoroscope/fluoroscope_request.hpp"
#include "xraycast/geometry/mesh.hpp"
#include "xraycast/reports/run_comparison.hpp"
#include "xraycast/sampling/clip_space.hpp"
#include "xraycast/scene/annotations.hpp"
#include "xraycast/scene/vessel_pick.hpp"
#include "xraycast/scene/vessels.hpp"

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <epoxy/gl.h>
#include <iterator>
#include <utility>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

/// `xraycast-001.png`, or the first free number.
fs::path unused(const std::string& stem, const std::string& extension) {
  fs::path path;
  for (int number = 1; path.empty() || fs::exists(path); ++number)
    path = fmt::format("{}-{:03}{}", stem, number, extension);
  return path;
}

bool is_vessels(const fs::path& path) {
  return is_surface_file(path) || fs::exists(path / "surface.vtp") || fs::exists(path / "surface.stl") ||
         !tree_file_in(path).empty();
}

/// What a file is opened as.
enum class Kind { session, basis, catheter, vessels, map, scan };

Kind kind_of(const fs::path& path) {
  const std::string extension = extension_of(path);
  if (extension == ".json") return Kind::session;
  if (extension == ".basis") return Kind::basis;
  if (extension == ".csv") return Kind::catheter;
  if (is_vessels(path)) return Kind::vessels;
  return extension == ".exr" ? Kind::map : Kind::scan;
}

/// All but what is a session.
void set_file(ViewSession& session, const fs::path& path) {
  switch (kind_of(path)) {
    case Kind::session:
      return;
    case Kind::basis:
      session.basis = path;
      return;
    case Kind::catheter:
      session.catheter = path;
      session.steered.reset();
      return;
    case Kind::vessels:
      session.vessels = path;
      session.steered.reset();
      return;
    case Kind::map:
      session.map = path;
      return;
    case Kind::scan:
      session.scan = path;
      return;
  }
}

/// The session with other files, in any order, or another session with them. A map or a scan takes the place
/// of all that belonged to the last body.
ViewSession with_files(ViewSession session, std::span<const fs::path> paths) {
  const auto is_body = [](const fs::path& path) {
    const Kind kind = kind_of(path);
    return kind == Kind::map || kind == Kind::scan;
  };
  for (const fs::path& path : paths)
    if (kind_of(path) == Kind::session) session = read_session(path);
  if (std::ranges::any_of(paths, is_body)) {
    session.map.clear();
    session.basis.clear();
    session.scan.clear();
    session.opacity.reset();
    session.has_window = false;
  }
  for (const fs::path& path : paths) set_file(session, path);
  return session;
}

}  // namespace

Viewer::Viewer(ViewSession session, std::string device, const std::function<void()>& request_redraw,
               BodyRequest body)
    : device_(std::move(device)), body_request_(std::move(body)), drrs_(request_redraw) {
  load(std::move(session), true);
}

bool Viewer::attempt(const std::function<void()>& action) {
  try {
    action();
    return true;
  } catch (const std::bad_alloc&) {
    message_ = "not enough memory";
  } catch (const std::exception& error) {
    message_ = error.what();
  }
  return false;
}

// ---- files ----------------------------------------------------------------------------------------

void Viewer::load(ViewSession wanted, bool takes_view) {
  wanted.style.pixels_per_column = kLivePixelsPerColumn;
  opening_.start("Opening",
                 [this, wanted = std::move(wanted), before = opened_,
                  takes_view](Progress& progress) -> Worker::Delivery {
                   const auto opened = std::make_shared<OpenedFiles>(
                       open_files(wanted, before, device_, progress, body_request_.motion));
                   return [this, opened, takes_view] { deliver(std::move(*opened), takes_view); };
                 });
}

/// Only what could be opened becomes part of the session.
void Viewer::deliver(OpenedFiles opened, bool takes_view) {
  is_first_ = false;
  const std::shared_ptr<const BodyMap> before = opened_.map;
  opened_ = std::move(opened);
  const CArmPose pose = session_.pose;
  const Style style = session_.style;
  session_ = opened_.session;
  if (!takes_view) {  // which may have been changed in the meantime
    session_.pose = pose;
    session_.style = style;
  }
  road_map_.reset();
  drrs_.reset();
  shown_exposures_ = -1;
  adapted_to_.reset();
  picked_.reset();
  std::vector<Surface> surfaces;
  for (const auto& surface : {opened_.vessels, opened_.catheter})
    if (surface && !intervention_) surfaces.push_back(*surface);
  if (!intervention_) std::ranges::copy(opened_.steered, std::back_inserter(surfaces));
  renderer_.set_implants(*opened_.implants);
  renderer_.set_surfaces(surfaces);
  shown_surfaces_ = 0;
  std::vector<std::string> notes = opened_.warnings;
  if (opened_.map && opened_.vessels)
    std::ranges::copy(notes_on_place(opened_.vessels->mesh.points_mm, bounds_of(opened_.map->geometry),
                                     session_.vessels.string()),
                      std::back_inserter(notes));
  if (!notes.empty()) message_ = fmt::format("{}", fmt::join(notes, "\n"));
  opacity_.open(opened_.map, opened_.recast);
  if (opened_.map != before)
    begin_body();
  else if (takes_view && body_)
    begin_at(std::exchange(session_.instant, {}));
}

void Viewer::open(std::span<const fs::path> paths) {
  attempt([&] {
    for (const fs::path& path : paths)
      if (!fs::exists(path)) throw InputError("{}: no such file or folder; check its name", path.string());
    message_.clear();
    is_first_ = false;
    load(with_files(session_, paths),
         std::ranges::any_of(paths, [](const fs::path& path) { return kind_of(path) == Kind::session; }));
  });
}

void Viewer::save_session() {
  attempt([&] {
    const fs::path path = "xraycast-session.json";
    ViewSession shown = session_;
    shown.pose = picture_pose();
    if (intervention_) shown.steered = intervention_->steered();
    shown.instant.clear();
    const std::vector<double> phases = phases_of_picture();
    for (std::size_t m = 0; m < phases.size(); ++m)
      shown.instant[shown_->keys->phases().rhythm().modes()[m].name] = phases[m];
    write_session(shown, path);
    message_ = "saved " + fs::absolute(path).string();
  });
}

void Viewer::save_picture() {
  attempt([&] {
    if (!shown_) throw InputError("there is no picture to save yet; open a body map first");
    const std::vector<Pane> all = panes(width_, height_);
    const int left = all.front().x, width = all.back().x + all.back().width - left,
              height = all.front().height;
    std::vector<std::uint8_t> rgb(static_cast<std::size_t>(3) * width * height);
    for (const Pane& pane : all) {
      const std::vector<std::uint8_t> part = annotated_picture(pane);
      const std::size_t row = std::size_t{3} * pane.width;
      for (int j = 0; j < height; ++j)
        std::copy_n(&part[j * row], row, &rgb[3 * (static_cast<std::size_t>(j) * width + pane.x - left)]);
    }
    // The name is chosen by the job: the one before it is done by then, and its file is there.
    writing_.start("Saving", [this, rgb = std::move(rgb), width, height](Progress&) -> Worker::Delivery {
      const fs::path path = unused("xraycast", ".png");
      write_picture(rgb, width, height, 3, path);
      return [this, path] { message_ = "saved " + fs::absolute(path).string(); };
    });
  });
}

/// What a pane shows.
std::vector<std::uint8_t> Viewer::annotated_picture(const Pane& pane) {
  const ProjectionImage* drr = pane.is_drr ? drrs_.latest() : nullptr;
  View drawn = drr ? drr->view : view_in(pane.width, pane.height);
  std::vector<std::uint8_t> rgb;
  if (is_fluoroscopy(pane) && !console()->image().empty()) {
    drawn = console()->view();
    for (const std::uint8_t grey : console()->image()) rgb.insert(rgb.end(), 3, grey);
  } else {
    rgb = drr ? renderer_.picture(*drr, session_.style) : renderer_.picture(drawn, session_.style);
  }
  annotate(rgb, drawn, bounds_, status_of(picture_pose()));
  draw_outline(road_map(drawn), kRoadMapColour, drawn.width, rgb);
  if (drawn.width == pane.width && drawn.height == pane.height) return rgb;
  Canvas canvas(pane.width, pane.height, {0, 0, 0});
  canvas.picture(rgb, drawn.width, drawn.height, box_in(pane, drawn));
  return canvas.rgb();
}

void Viewer::save_cine() {
  attempt([&] {
    if (!shown_) throw InputError("there is no picture to save yet; open a body map first");
    cine_.emplace(unused("xraycast-cine", ""), session_.pose);
    cine_begin_s_ = body_ ? body_->time_s() : 0;
  });
}

void Viewer::export_cine_frame() {
  if (body_) show_body(body_->phases_at(cine_begin_s_ + cine_->frame() * CineWriter::kUsualFrame_s));
  cine_->export_frame([this](const CArmPose& pose) {
    const View view = view_of(pose, bounds_, CineExporter::kWidth, CineExporter::kHeight);
    std::vector<std::uint8_t> rgb = renderer_.picture(view, session_.style);
    annotate(rgb, view, bounds_, status_of(pose));
    return rgb;
  });
  if (!cine_->is_complete()) return;
  message_ =
      fmt::format("saved {} frames in {}", CineExporter::kFrames, fs::absolute(cine_->folder()).string());
  cine_.reset();
}

void Viewer::cancel() {
  if (!status()) return;
  opening_.cancel();
  cine_.reset();
  message_ = "cancelled";
}

bool Viewer::is_animating() const { return is_rotating || cine_; }

std::optional<Worker::Status> Viewer::status() const {
  if (cine_) return Worker::Status{"Cine", "drawing", cine_->fraction()};
  return opening_.status();
}

// ---- the catheter ---------------------------------------------------------------------------------

/// The catheter as in the last exposure.
void Viewer::show_catheter() {
  intervention_->blur(blur_of(panes(width_, height_).front()));
  intervention_->update(session_.pose, since_frame_.ms() / 1000);
  if (intervention_->exposures() == shown_exposures_) return;
  shown_exposures_ = intervention_->exposures();
  // A wire has another number of surfaces than the catheter that it is exchanged for.
  if (std::exchange(shown_surfaces_, intervention_->surfaces().size()) != intervention_->surfaces().size())
    return renderer_.set_surfaces(intervention_->surfaces());
  for (std::size_t i = 0; i < intervention_->surfaces().size(); ++i)
    renderer_.replace_surface(i, intervention_->surfaces()[i]);
}

/// Of a fluoroscope's pulses.
PulseBlur Viewer::blur_of(const Pane& pane) const {
  if (!is_fluoroscopy(pane)) return {};
  const View view = view_of(session_.pose, bounds_, std::max(1, pane.width), std::max(1, pane.height));
  return {.pulse_s = 1e-3 * console()->options().c_arm.tube.pulse_ms, .pixel_mm = pixel_at_axis_mm(view)};
}

/// Keeps the tip of the instrument in the hand within the middle of live pictures when it or the zoom has
/// changed. What was subtracted or mapped would be lost with the view: then the table stays where it is.
void Viewer::follow_tip(const Pane& pane) {
  constexpr double kStill_mm = 0.5;
  const bool keeps_view = console() && (console_->subtracts() || console_->shows_road_map());
  if (!follows || !(lacks_picture_ || (pedal_ && !keeps_view))) return;
  CArmPose& pose = session_.pose;
  const glm::dvec3 tip_mm = intervention_->run().now().instrument(intervention_->held_hub()).nodes_mm.back();
  if (glm::distance(tip_mm, followed_mm_) < kStill_mm && pose.zoom == followed_zoom_) return;
  followed_mm_ = tip_mm;
  followed_zoom_ = pose.zoom;
  const View view = view_of(pose, bounds_, pane.width, pane.height);
  const glm::dvec2 size(pane.width, pane.height), tip = pixel_of(view, tip_mm);
  // Most entries are at the body's lower end, and most ways go up from there.
  const glm::dvec2 beyond = tip - glm::clamp(tip, 0.25 * size, glm::dvec2(0.75, 0.88) * size);
  // Pixels per mm in the plane of the tip.
  const double scale = glm::distance(pixel_of(view, tip_mm + view.right()), tip);
  pose.travel((beyond.x * view.right() - beyond.y * view.up()) / scale, bounds_);
}

void Viewer::toggle_recording() {
  attempt([&] {
    SimulatedRun& run = intervention_->run();
    if (!run.is_recording()) return run.start_recording();
    recording_ = unused("xraycast-run", ".csv");
    recorded_ = run.models();
    write_whole_file(recording_, run.stop_recording());
    message_ = "saved " + fs::absolute(recording_).string();
  });
}

void Viewer::replay() {
  attempt([&] {
    if (recording_.empty()) throw InputError("there is no recording yet; press Record, then Stop recording");
    std::string report = graded_report_ ? *graded_report_ : intervention_->run().monitor().json(true);
    intervention_->replay(recording_, recorded_);
    graded_report_ = std::move(report);
  });
}

void Viewer::restart_run() {
  lacks_picture_ = true;
  if (console_) console_->forget_pictures();  // a mask shows the instruments of the run before
  graded_report_.reset();
  attempt([&] { intervention_->restart(); });
}

void Viewer::save_report() {
  attempt([&] {
    const fs::path file = report_.empty() ? unused("xraycast-report", ".html") : report_;
    write_report(file, graded_report_ ? *graded_report_ : intervention_->run().monitor().json(true));
    message_ = "saved " + fs::absolute(file).string();
    if (graded_report_) message_ += ", of the run before the replay";
  });
}

std::span<const glm::ivec2> Viewer::road_map(const View& view) {
  if (console()) return {};  // the fluoroscope has its own
  if (intervention_) return intervention_->road_map(view);
  if (!session_.steered || !session_.steered->has_road_map || !opened_.tree) return {};
  if (!road_map_) road_map_.emplace(*opened_.tree);
  return road_map_->outline(view);
}

// ---- the body --------------------------------------------------------------------------------------

/// Of a map that moves, by the motion's rhythm where its fields are not there.
void Viewer::begin_body() {
  body_.reset();
  exposed_phases_.clear();
  if (intervention_ || !opened_.map) return;
  if (!opened_.map->keys) {
    if (!body_request_.motion) check(body_request_);
    return;
  }
  BodyRequest request = body_request_;
  request.motion =
      opened_.motion ? opened_.motion : std::make_shared<const Motion>(opened_.map->keys->phases().rhythm());
  body_ = std::make_unique<LiveBody>(request);
  begin_at(std::exchange(session_.instant, {}));
  match_masks(mask_phase_);
}

/// The body goes on from the session's instant, or stays there beside instruments that do not move. What is
/// held by request is.
void Viewer::begin_at(const std::map<std::string, double>& instant) {
  for (const auto& [mode, phase] : instant) {
    const auto& modes = body_->motion().modes();
    const bool is_there = std::ranges::find(modes, mode, &MotionMode::name) != modes.end();
    if (!is_there || body_request_.phase.contains(mode)) continue;
    body_->change({.holds = {{mode, {.is_held = true, .phase = phase}}}});
    if (!session_.steered) body_->change({.holds = {{mode, {.is_held = false}}}});
  }
}

bool Viewer::is_moving() const {
  const auto goes_on = [](const BodyModeState& mode) { return !mode.is_held; };
  return body() && std::ranges::any_of(body()->modes(), goes_on);
}

/// For the body, and for its gate.
void Viewer::pass_time(double passed_s) {
  is_gate_open_ = !intervention_ || intervention_->has_exposed();
  if (!body_) return;
  body_->advance(passed_s);
  const std::optional<double> exposure_s = body_->exposure_s(0);
  is_gate_open_ = exposure_s.has_value();
  if (exposure_s || exposed_phases_.empty())
    exposed_phases_ = body_->phases_at(exposure_s.value_or(body_->time_s()));
}

/// A true projection is of the scan, and so is the map beside it.
std::vector<double> Viewer::phases_of_picture() const {
  if (!shown_ || !shown_->keys) return {};
  const std::size_t modes = shown_->keys->phases().phases().size();
  const std::vector<double>& exposed = intervention_ ? intervention_->phases() : exposed_phases_;
  const bool is_of_scan = has_scan() && (is_split || source() == BodySource::drr);
  return is_of_scan || exposed.size() != modes ? std::vector<double>(modes, 0.0) : exposed;
}

/// With its vessels.
void Viewer::show_body(std::span<const double> phases) {
  if (phases.empty()) return;
  renderer_.set_phases(phases);
  if (intervention_ || !opened_.moving_vessels) return;
  vessel_points_mm_.resize(opened_.moving_vessels->size());
  opened_.moving_vessels->at(phases, vessel_points_mm_);
  renderer_.move_surface(0, vessel_points_mm_);
}

// ---- the fluoroscope -------------------------------------------------------------------------------

void Viewer::toggle_console() {
  attempt([&] {
    if (!console_) return use_fluoroscope(options_of({}));
    is_console_on_ = !is_console_on_;
    lacks_picture_ = is_console_on_;
  });
}

void Viewer::use_fluoroscope(const FluoroscopyOptions& options) {
  FluoroscopyOptions with_field = options;
  if (with_field.field_mm == 0) with_field.field_mm = options.c_arm.fields_mm.front();
  console_.emplace(with_field);
  is_console_on_ = fits_field_ = lacks_picture_ = true;
  match_masks(mask_phase_);
}

void Viewer::match_masks(const std::optional<MaskPhase>& phase) {
  mask_phase_ = phase;
  if (!console_ || !body()) return;
  console_->match_masks(phase ? std::optional(matching_of(*phase, body()->motion())) : std::nullopt);
}

/// Magnifies so that the fluoroscope's field fills the picture.
void Viewer::fit_field(const Pane& pane) {
  fits_field_ = false;
  const Cone& distances = console_->options().c_arm.distances;
  const double pixel_mm = std::max(field_mm().x / pane.width, field_mm().y / pane.height) *
                          distances.source_axis_mm / distances.source_detector_mm;
  const View now = view_of(session_.pose, bounds_, pane.width, pane.height);
  session_.pose.magnify(now.pixel_mm / pixel_mm);
}

void Viewer::toggle_console_road_map() {
  console_->show_road_map(!console_->shows_road_map());
  if (console_->has_angiogram()) return console_->subtract(false);
  message_ = "there is no angiogram for a road map yet: subtract (G), hold the pedal (X), and inject (I)";
}

void Viewer::press_pedal(bool is_down) {
  pedal_ = is_down;
  if (intervention_) intervention_->press_pedal(is_down);
}

View Viewer::shown_in(const Pane& pane) const {
  if (!is_fluoroscopy(pane) || console()->image().empty()) return view_in(pane.width, pane.height);
  View view = console()->view();
  view.pixel_mm *= view.width / box_in(pane, view).width;
  view.width = pane.width;
  view.height = pane.height;
  return view;
}

bool Viewer::is_held() const {
  return shown_ && !pedal_ && (intervention_ || (console() && !console()->image().empty()));
}

/// Where a picture of another size is in a pane, without changing its shape; from the pane's corner on.
PixelBox Viewer::box_in(const Pane& pane, const View& view) {
  const double scale = std::min(1.0 * pane.width / view.width, 1.0 * pane.height / view.height);
  const double width = std::round(scale * view.width), height = std::round(scale * view.height);
  return {std::floor((pane.width - width) / 2), std::floor((pane.height - height) / 2), width, height};
}

/// A pulse where one is due, and the held image. Like a detector's, the picture has no more pixels than are
/// worth their noise: on a screen of high density each is shown as several.
void Viewer::draw_fluoroscopy(const Pane& pane) {
  if (std::exchange(lacks_picture_, false) || is_pulse_due_) {
    constexpr int kMostPixels = 1280;
    const int screen_px = 1 + (std::max(pane.width, pane.height) - 1) / kMostPixels;
    exposed_from_ = session_.pose;
    const View view = view_in(pane.width / screen_px, pane.height / screen_px);
    if (!water_path_) water_path_.emplace(shown_->attenuation);
    if (body()) console_->set_motion_speed(body()->speed());
    console_->expose(renderer_.tau(view, session_.style), view, *water_path_, phases_of_picture());
    if (body() && is_pulse_due_) body()->mark_exposure(body()->time_s());
    held_.set(console_->image(), view.width, view.height);
  }
  if (console_->image().empty()) return;
  const PixelBox box = box_in(pane, console_->view());
  held_.draw(pane.x + static_cast<int>(box.left), pane.y + static_cast<int>(box.top),
             static_cast<int>(box.width), static_cast<int>(box.height));
}

// ---- the vessels ----------------------------------------------------------------------------------

const VesselTree* Viewer::tree() const {
  return intervention_ ? &intervention_->run().tree() : opened_.tree.get();
}

void Viewer::pick(const glm::dvec2& position, float width, float height) {
  picked_.reset();
  if (!tree() || !shown_) return;
  for (const Pane& pane : panes(static_cast<int>(width), static_cast<int>(height)))
    if (position.x >= pane.x && position.x < pane.x + pane.width)
      picked_ = vessel_at(*tree(), shown_in(pane), position - glm::dvec2(pane.x, 0));
}

// ---- how it is shown ------------------------------------------------------------------------------

BodySource Viewer::source() const {
  if (shows_drr_ && has_scan()) return BodySource::drr;
  return session_.style.sampling.compositing == Compositing::path ? BodySource::path : BodySource::wall;
}

void Viewer::set_source(BodySource source) {
  shows_drr_ = source == BodySource::drr && has_scan();
  session_.style.sampling.compositing = source == BodySource::wall ? Compositing::wall : Compositing::path;
}

void Viewer::next_source() {
  switch (source()) {
    case BodySource::path:
      return set_source(BodySource::wall);
    case BodySource::wall:
      return set_source(has_scan() ? BodySource::drr : BodySource::path);
    case BodySource::drr:
      return set_source(BodySource::path);
  }
}

void Viewer::set_look(Look look) {
  session_.style.look = look;
  session_.style.window.inverted = look == Look::surface;
}

void Viewer::show_map(std::shared_ptr<const BodyMap> map) {
  if (!map || map == shown_) return;
  if (!shown_ || shown_->geometry != map->geometry) {
    adapted_to_.reset();
    lacks_picture_ = true;
  }
  shown_ = std::move(map);
  water_path_.reset();
  if (console_) console_->forget_pictures();
  renderer_.set_map(shown_);
  bounds_ = bounds_of(shown_->geometry);
}

// ---- the picture ----------------------------------------------------------------------------------

const CArmPose& Viewer::picture_pose() const {
  if (intervention_) return intervention_->pose();
  return is_held() ? exposed_from_ : session_.pose;
}

std::string Viewer::caption() const {
  return intervention_ ? intervention_->caption(session_.pose) : status_of(picture_pose());
}

void Viewer::reset_view() {
  session_.pose = {};
  fits_field_ = console() != nullptr;
}

View Viewer::view_in(int width, int height) const {
  return view_of(picture_pose(), bounds_, std::max(1, width), std::max(1, height));
}

/// What the fluoroscope's detector sees, on the detector.
glm::dvec2 Viewer::field_mm() const {
  const FluoroscopyOptions& options = console_->options();
  return glm::min(glm::dvec2(options.field_mm),
                  {options.c_arm.detector.width_mm, options.c_arm.detector.height_mm});
}

std::vector<Viewer::Pane> Viewer::panes(int width, int height) const {
  const bool is_drr = source() == BodySource::drr;
  const int across = std::max(1, width - reserved_right_), down = std::max(1, height - reserved_below_),
            y = height - down, half = across / 2;
  if (is_split && has_scan() && half > 0)
    return {{0, y, half, down, false}, {half, y, across - half, down, true}};
  if (!console() || is_drr) return {{0, y, across, down, is_drr}};
  // The detector's shape.
  const int seen = std::clamp(static_cast<int>(std::lround(down * field_mm().x / field_mm().y)), 1, across);
  return {{(across - seen) / 2, y, seen, down, false}};
}

void Viewer::draw_pane(const Pane& pane) {
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  glViewport(pane.x, pane.y, pane.width, pane.height);
  if (pane.is_drr)
    draw_drr(pane);
  else if (is_fluoroscopy(pane))
    draw_fluoroscopy(pane);
  else
    renderer_.draw(view_in(pane.width, pane.height), session_.style, pane.x, pane.y);
}

/// The latest DRR that was projected; another one is requested when something has changed.
void Viewer::draw_drr(const Pane& pane) {
  drrs_.request(view_in(pane.width, pane.height), shown_->opacity(), opened_.scan);
  const ProjectionImage* drr = drrs_.latest();
  if (drr && drr->view.width == pane.width && drr->view.height == pane.height)
    renderer_.draw(*drr, session_.style, pane.x, pane.y);
}

/// The grey window follows the C-arm and the table, until one is chosen by hand. Motion and edits within the
/// same view do not change it.
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
    show_map(opacity_.map());
    if (drrs_.take_results() && is_split && shown_)
      drrs_.compare(renderer_.body_tau(drrs_.latest()->view, session_.style));
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
  constexpr double kRotation_deg = 2.5;
  if (is_rotating) session_.pose.rotate(kRotation_deg);
  if (console() && fits_field_) fit_field(panes(width, height).front());
  if (intervention_)
    attempt([&] {
      follow_tip(panes(width, height).front());
      if (console()) intervention_->count_generator(console()->use());
      show_catheter();
    });
  pass_time(since_frame_.ms() / 1000);
  is_pulse_due_ = console() && console_->is_due(pedal_, since_frame_.ms() / 1000, is_gate_open_);
  since_frame_ = {};
  if (cine_ && !attempt([&] { export_cine_frame(); })) cine_.reset();
  attempt([&] {
    if (!console() || lacks_picture_ || is_pulse_due_) show_body(phases_of_picture());
    const std::vector<Pane> all = panes(width, height);
    if (!std::ranges::all_of(all, [&](const Pane& pane) { return is_fluoroscopy(pane); }))
      adapt_brightness(view_in(all.front().width, all.front().height));
    for (const Pane& pane : all) draw_pane(pane);
  });
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  glViewport(0, 0, width, height);
  glFinish();
  frame_ms_ = stopwatch.ms();
}

}  // namespace xraycast
