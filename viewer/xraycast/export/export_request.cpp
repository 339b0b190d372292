#include "xraycast/export/export_request.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/casting/key_maps.hpp"
#include "xraycast/casting/outline_bands.hpp"
#include "xraycast/export/gltf_file.hpp"
#include "xraycast/export/web_page.hpp"
#include "xraycast/sampling/column_samples.hpp"
#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/contrast_surface.hpp"
#include "xraycast/scene/pulse_blur.hpp"
#include "xraycast/scene/same_scan.hpp"
#include "xraycast/scene/vessels.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

void check_map(const BodyMap& map, const std::string& name) {
  const MapGeometry& geometry = map.geometry;
  if (map.spectrum())
    throw InputError(
        "{}: holds materials for a spectrum, which a page cannot draw; cast it with `opacity` paper", name);
  if (geometry.ray_layout != RayLayout::cylinder)
    throw InputError("{}: a page shows cylinder maps alone; cast it with `projection` cylinder", name);
  if (geometry.centre_mm.size() > 1)
    throw InputError("{}: a page shows maps about a straight axis alone; cast it without `centre_line`",
                     name);
  if (!suits_web(map))
    throw InputError("{}: its rows have more than {} outlines; cast it anew", name, kMostOutlineBands);
  if (geometry.width > kMostWebAngles)
    throw InputError("{}: {} angles, but a page holds at most {}; cast it with `angles` {}", name,
                     geometry.width, kMostWebAngles, kMostWebAngles);
  if (geometry.height > kMostWebRows)
    throw InputError(
        "{}: {} rows, one a slice, but a page holds at most {}; cast a scan that is resampled to "
        "thicker slices",
        name, geometry.height, kMostWebRows);
  const std::int64_t area = std::int64_t{geometry.width} * geometry.height;
  static_assert(std::int64_t{kMostWebAngles} * kMostWebRows <= kMostWebTexels);  // one layer always fits
  const std::int64_t most_layers = std::min<std::int64_t>(kMostWebLayers, kMostWebTexels / area);
  if (geometry.layers() > most_layers)
    throw InputError(
        "{}: {} of {} x {} texels, but a page holds at most {} of them; cast it with `layers` {}", name,
        pluralize(geometry.layers(), "layer"), geometry.width, geometry.height, most_layers, most_layers);
}

bool has_page_modes(const KeyMaps& keys) { return keys.phases().phases().size() <= kMostWebModes; }
bool has_page_size(const KeyMaps& keys) { return keys.size_B() <= kMostWebKeyTexels; }

/// Of a map that moves.
void check_keys(const ExportRequest& request) {
  const BodyMap& map = *request.map;
  const std::string& name = request.map_name;
  if (request.precision != MapPrecision::byte)
    throw InputError("{}: moves, and such maps are of bytes; leave out `precision`", name);
  if (!has_page_modes(*map.keys))
    throw InputError("{}: moves by {} modes, but a page shows at most {}; cast it by a motion with fewer",
                     name, map.keys->phases().phases().size(), kMostWebModes);
  if (!has_page_size(*map.keys))
    throw InputError(
        "{}: its key maps have {} million texels, but a page holds at most {}; give fewer `keys`", name,
        map.keys->size_B() / 1'000'000, kMostWebKeyTexels / 1'000'000);
}

/// How the page's body moves: by its map's own rhythm, whose fields a page has not.
BodyRequest rhythm_of(const ExportRequest& request) {
  BodyRequest body = request.body;
  body.motion = {request.map->keys, &request.map->keys->phases().rhythm()};
  return body;
}

void check_motion(const ExportRequest& request) {
  const BodyRequest& body = request.body;
  const bool is_given = body.motion || !body.phase.empty() || body.speed != 1 || body.gate;
  if (!request.map->keys) {
    if (is_given)
      throw InputError(
          "{}: stands still; cast one that moves with `motion` alone, or leave out what moves it",
          request.map_name);
    return;
  }
  if (body.motion) check_same_modes(*request.map, *body.motion);
  check(rhythm_of(request));
}

/// What the program says of its objects has been said where it opened them.
std::vector<Surface> implants_of(const ViewSession& session) {
  std::vector<std::string> said;
  std::vector<Surface> implants = surfaces_of(read_implants(session.implants, said));
  for (const Surface& implant : implants)
    if (implant.mesh.triangles.size() > kMostWebTriangles)
      throw InputError("an object of {} triangles, but an export holds at most {}; simplify its surface",
                       implant.mesh.triangles.size(), kMostWebTriangles);
  return implants;
}

void check_vessels(const Surface& vessels, const BodyBounds& bounds, const std::string& name) {
  if (vessels.mesh.triangles.size() > kMostWebTriangles)
    throw InputError("{}: {} triangles, but an export holds at most {}; segment again with fewer `triangles`",
                     name, vessels.mesh.triangles.size(), kMostWebTriangles);
  if (!notes_on_place(vessels.mesh.points_mm, bounds, name).empty())
    throw InputError("{}: most of it lies outside the body map; give the vessels of the scan that was cast",
                     name);
}

/// A catheter of control points, meshed once their number is known to be sensible.
Surface read_small_catheter(const std::filesystem::path& path) {
  constexpr std::ptrdiff_t kMostPoints = 5000;  // nearly kMostWebTriangles
  const std::string text = read_whole_file(path);
  if (std::ranges::count(text, '\n') > kMostPoints)
    throw InputError(
        "{}: more than {} lines, but an export holds a catheter of at most {} control points; give fewer",
        path.string(), kMostPoints, kMostPoints);
  return read_catheter(path);
}

ExportRequest request_of(const ViewSession& session, std::shared_ptr<const BodyMap> map) {
  ExportRequest request;
  request.map = std::move(map);
  request.pose = session.pose;
  request.style = session.style;
  request.has_window = session.has_window;
  request.map_name = session.map.string();
  request.vessels_name = session.vessels.string();
  return request;
}

LiveRun live_run_of(const RunRequest& run, const std::string& vessels_name) {
  const ContrastSurface contrast(*run.tree);
  if (const std::size_t triangles = contrast.drums() * ContrastSurface::kDrumTriangles;
      triangles > kMostWebTriangles)
    throw InputError("{}: {} triangles of contrast agent, but a page holds at most {}; give a shorter tree",
                     vessels_name, triangles, kMostWebTriangles);
  LiveRun live{.instruments = run.instruments, .contrast = contrast.whole()};
  for (int branch = 0; branch < std::ssize(run.tree->branches()); ++branch)
    live.vessels.push_back(run.tree->title(branch));
  return live;
}

Exercise with_shown_names(Exercise exercise) {
  for (std::vector<std::string>* names : {&exercise.instruments, &exercise.devices})
    for (std::string& name : *names) name = shown_name(name);
  return exercise;
}

/// A page controls its exposure by itself, has blades of its own, and all stages.
void check_suits_page(const FluoroscopeRequest& asked) {
  if (asked.field_mm || !asked.collimate.empty() || asked.kvp || asked.mas || asked.photons ||
      !asked.stages.empty())
    throw InputError(
        "a page's fluoroscope takes C-arm, dose, pulse rate, compression and seed; leave out the others");
}

/// Behind those that are there, of other names.
void add_choices(const std::vector<InstrumentModel>& others, std::vector<InstrumentModel>& choices) {
  for (const InstrumentModel& model : others)
    if (std::ranges::find(choices, model.name(), &InstrumentModel::name) == choices.end())
      choices.push_back(model);
}

/// A field of a width at the isocentre, with an entry at its edge, from where instruments go towards the
/// body's middle.
void show_field(CArmPose& pose, double seen_mm, double entry_height_mm, const BodyBounds& bounds) {
  constexpr int kPixels = 1000;
  constexpr double kAhead = 0.35;
  pose.zoom = 1;
  pose.magnify(kPixels * pixel_at_axis_mm(view_of(pose, bounds, kPixels, kPixels)) / seen_mm);
  const double height_mm = entry_height_mm - bounds.centre_mm.z;
  pose.travel(height_mm - std::copysign(kAhead * seen_mm, height_mm) - pose.table_mm, bounds);
}

}  // namespace

ExportFormat export_format(const std::string& file) {
  if (has_extension(file, ".html")) return ExportFormat::page;
  if (has_extension(file, ".glb")) return ExportFormat::gltf;
  throw InputError("{}: must end in .html, for a page, or in .glb, for a glTF scene", file);
}

bool suits_web(const BodyMap& map) {
  return map.geometry.ray_layout == RayLayout::cylinder && has_columns(map.geometry) && !map.spectrum();
}

std::vector<std::string> check(const ExportRequest& request) {
  const bool is_page = request.format == ExportFormat::page;
  if (is_page) check_map(*request.map, request.map_name);
  check_motion(request);
  if (is_page && moves(request)) check_keys(request);
  if (request.vessels)
    check_vessels(*request.vessels, bounds_of(request.map->geometry), request.vessels_name);
  std::vector<std::string> notes;
  if (request.trainer && request.map->keys && !request.body.motion)
    notes.emplace_back(
        "the page's body stands still at phase 0 of its motion while it is steered; give `motion`, by which "
        "it "
        "was cast, to move it");
  if (request.live && request.map->keys && request.body.motion && !moves(request))
    notes.emplace_back(
        "the web page shows the body at phase 0 of its motion: its key maps are too many for a page");
  if (!is_page || request.live) return notes;
  if (request.map->keys && !moves(request))
    notes.emplace_back(
        "the run's instruments moved in a body that stood still, which the page shows at phase 0");
  else if (request.map->keys && request.vessels && !request.body.motion)
    notes.emplace_back(
        "the vessels stay where they are at phase 0 of the map's motion; give `motion`, by which it was "
        "cast, "
        "to move them too");
  if (request.style.sampling != SampleOptions{})
    notes.emplace_back(
        "a page adds up shells by the path in each, reconstructed linearly; the session's walls or constant "
        "shells are not exported");
  return notes;
}

bool moves(const ExportRequest& request) {
  const std::shared_ptr<const KeyMaps>& keys = request.map->keys;
  if (!keys) return false;
  // A session goes on where its page cannot show all of it.
  if (request.live) return request.body.motion && has_page_modes(*keys) && has_page_size(*keys);
  return !request.run || request.run->moves;
}

std::vector<double> first_phases(const ExportRequest& request) { return phases_at(rhythm_of(request), 0); }

ExportRequest exported_session(const ViewSession& session, std::shared_ptr<const BodyMap> map) {
  ExportRequest request = request_of(session, std::move(map));
  if (!session.vessels.empty()) request.vessels = read_vessels(session.vessels, session.contrast_mg_ml);
  if (session.steered)
    request.catheters = steered_surfaces(*session.steered);
  else if (!session.catheter.empty())
    request.catheters = {read_small_catheter(session.catheter)};
  request.implants = implants_of(session);
  request.shows_vessels = !session.steered;
  request.shows_road_map = session.steered && session.steered->has_road_map;
  return request;
}

void make_steered(ExportRequest& request, const RunRequest& run, const std::vector<InstrumentModel>& others,
                  const FluoroscopeRequest& fluoroscope) {
  check_suits_page(fluoroscope);
  request.fluoroscope = options_of(fluoroscope);
  if (request.pose.cone)
    request.fluoroscope.c_arm.distances = *request.pose.cone;
  else if (!fluoroscope.c_arm.empty())
    request.pose.cone = request.fluoroscope.c_arm.distances;
  TrainerSetup setup{.tree = run.tree, .choices = run.instruments, .used = {}, .entry = entry_of(run)};
  // A wire is hardly seen in a picture of the whole body.
  constexpr double kSeen_mm = 300;
  const Cone& cone = request.fluoroscope.c_arm.distances;
  const double seen_mm = fluoroscope.c_arm.empty()
                             ? kSeen_mm
                             : request.fluoroscope.field_mm * cone.source_axis_mm / cone.source_detector_mm;
  if (!request.is_of_session)
    show_field(request.pose, seen_mm, setup.entry.position_mm.z(), bounds_of(request.map->geometry));
  if (request.map->keys && request.body.motion && has_page_modes(*request.map->keys) &&
      has_page_size(*request.map->keys))
    setup.motion = PageMotion::about(*run.tree, *request.body.motion);
  for (std::size_t d = 0; d < run.instruments.size(); ++d) setup.used.push_back(d);
  add_choices(others, setup.choices);
  request.live = live_run_of(run, request.vessels_name);
  for (const PageMotion::Mode& mode : setup.motion.modes) request.live->modes.push_back(mode.name);
  request.trainer = std::move(setup);
  request.catheters.clear();
}

void add_exercises(ExportRequest& request, const std::vector<Exercise>& exercises) {
  const std::shared_ptr<const VesselTree>& tree = request.trainer->tree;
  for (const Exercise& exercise : exercises) {
    TrainerSetup setup{.tree = tree, .exercise = to_json(with_shown_names(exercise))};
    setup.motion = request.trainer->motion;
    setup.choices = instruments_named(exercise.instruments);
    for (std::size_t d = 0; d < setup.choices.size(); ++d) setup.used.push_back(d);
    setup.entry = find_entry(*tree, exercise.entry, setup.choices.front());
    add_choices(instruments_named(exercise.devices), setup.choices);
    request.exercises.push_back({exercise, std::move(setup)});
  }
}

ExportRequest live_session(const ViewSession& session, const CArmPose& pose,
                           std::shared_ptr<const BodyMap> map, const RunRequest& run, bool has_hub) {
  ExportRequest request = request_of(session, std::move(map));
  request.title = "Live fluoroscopy";
  request.vessels = std::filesystem::is_directory(session.vessels)
                        ? read_vessels(session.vessels, session.contrast_mg_ml)
                        : Surface{.mesh = tube_mesh(*run.tree),
                                  .mu_per_mm = fluoroscopy_per_mm("I", session.contrast_mg_ml)};
  request.live = live_run_of(run, request.vessels_name);
  request.live->has_hub = has_hub;
  if (run.body.motion)
    for (const MotionMode& mode : run.body.motion->modes()) request.live->modes.push_back(mode.name);
  if (request.map->keys) request.body = run.body;
  request.implants = implants_of(session);
  request.pose = pose;
  request.is_of_session = true;
  request.shows_vessels = false;
  return request;
}

std::string shown_name(const std::string& instrument) {
  std::error_code error;
  const bool is_file = std::filesystem::is_regular_file(instrument, error);
  return is_file ? std::filesystem::path(instrument).stem().string() : instrument;
}

std::string export_bytes(const ExportRequest& request) {
  check(request);
  return request.format == ExportFormat::page ? web_page(request) : gltf_binary(request);
}

}  // namespace xraycast
