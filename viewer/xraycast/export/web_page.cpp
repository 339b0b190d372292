#include "xraycast/export/web_page.hpp"

#include "xraycast/base/base64.hpp"
#include "xraycast/base/deflated.hpp"
#include "xraycast/base/html_text.hpp"
#include "xraycast/casting/outline_bands.hpp"
#include "xraycast/export/embedded_page.hpp"
#include "xraycast/export/packed_lattice.hpp"
#include "xraycast/export/packed_layers.hpp"
#include "xraycast/export/packed_mesh.hpp"
#include "xraycast/sampling/key_texels.hpp"
#include "xraycast/sampling/map_texels.hpp"
#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/contrast_surface.hpp"
#include "xraycast/scene/device_surface.hpp"
#include "xraycast/scene/road_map.hpp"
#include "xraycast/scene/vessels.hpp"
#include "xraycast/trainer/fluoroscope_setup.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <optional>
#include <string_view>
#include <utility>

namespace xraycast {
namespace {

using PageJson = nlohmann::ordered_json;

constexpr int kFormat = 4;

// ---- text -----------------------------------------------------------------------------------------

/// JSON that can stand in a script element.
std::string in_script(const PageJson& json) {
  const std::string text = json.dump(-1, ' ', true, PageJson::error_handler_t::replace);
  std::string escaped;
  for (const char c : text)
    if (c == '<')
      escaped += "\\u003c";
    else
      escaped += c;
  return escaped;
}

/// The template with every mark @xraycast-NAME@ replaced.
std::string filled(std::string_view page, std::span<const std::pair<std::string_view, std::string>> values) {
  constexpr std::string_view kMark = "@xraycast-";
  std::string result;
  for (std::size_t at; (at = page.find(kMark)) != std::string_view::npos;) {
    result += page.substr(0, at);
    page.remove_prefix(at + kMark.size());
    const std::size_t end = page.find('@');
    const std::string_view name = page.substr(0, end);
    for (const auto& [known, value] : values)
      if (known == name) result += value;
    page.remove_prefix(end + 1);
  }
  return result += page;
}

// ---- data -----------------------------------------------------------------------------------------

/// The page's numbers, one part behind the other.
class Parts {
 public:
  void add(const std::string& name, std::string_view bytes) {
    index_[name] = {bytes_.size(), bytes.size()};
    bytes_ += bytes;
  }
  template <typename Number>
  void add(const std::string& name, const std::vector<Number>& values) {
    static_assert(std::endian::native == std::endian::little);  // as in browsers
    add(name, std::string_view(reinterpret_cast<const char*>(values.data()), sizeof(Number) * values.size()));
  }
  const PageJson& index() const { return index_; }
  const std::string& bytes() const { return bytes_; }

 private:
  PageJson index_ = PageJson::object();
  std::string bytes_;
};

PageJson list(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

/// `keys` of a body that moves.
PageJson add_map(const ExportRequest& session, std::optional<PackedKeys>& keys, Parts& parts) {
  const MapGeometry geometry = drawn_geometry(*session.map);
  const PackedLayers layers = keys ? std::move(keys->first) : pack_layers(*session.map, session.precision);
  parts.add("layers", layers.bytes);
  std::vector<float> reaches, scales;
  PageJson bands = PageJson::array();
  for (const OutlineBand& band : outline_bands(geometry)) {
    bands.push_back(band.first_row);
    for (int column = 0; column < geometry.width; ++column) {
      reaches.push_back(static_cast<float>(geometry.reach_mm(column, band.first_row)));
      scales.push_back(static_cast<float>(geometry.scale(column, band.first_row)));
    }
  }
  parts.add("reaches", reaches);
  parts.add("scales", scales);
  PageJson ranges = PageJson::array();
  for (const LayerByteRange& range : layers.byte_ranges) ranges.push_back({range.offset, range.scale});
  const BodyBounds bounds = bounds_of(geometry);
  return {{"width", geometry.width},
          {"height", geometry.height},
          {"layers", geometry.layers()},
          {"radii_mm", geometry.radii_mm},
          {"centre_mm", {geometry.centre_mm[0].x, geometry.centre_mm[0].y}},
          {"top_mm", geometry.top_mm},
          {"row_mm", geometry.row_spacing_mm},
          {"field_mm", geometry.field ? PageJson(geometry.field->corners_mm()) : PageJson()},
          {"has_outline", geometry.has_outline()},
          {"bands", bands},
          {"bounds",
           {{"centre_mm", list(bounds.centre_mm)},
            {"radius_mm", bounds.radius_mm},
            {"half_height_mm", bounds.half_height_mm},
            {"finest_mm", bounds.finest_mm}}},
          {"precision", to_string(session.precision)},
          {"ranges", ranges}};
}

/// A mode, and the phases of its key maps.
PageJson mode_json(const MotionMode& mode, const std::vector<double>& phases) {
  PageJson json{{"name", mode.name}, {"wraps", mode.wraps()}, {"phases", phases}};
  if (mode.waveform.empty()) json["period_s"] = mode.period_s;
  for (const PhaseSample& sample : mode.waveform) json["waveform"].push_back({sample.time_s, sample.phase});
  return json;
}

/// How vessels move.
PageJson add_lattice(const ExportRequest& session, Parts& parts) {
  if (!session.vessels || !session.body.motion) return {};
  Progress progress;
  const PackedLattice lattice = pack_lattice(session.vessels->mesh.points_mm, *session.body.motion, progress);
  parts.add("lattice_nodes", lattice.numbers);
  parts.add("lattice_ways", lattice.ways);
  PageJson origin_mm = PageJson::array();
  for (const std::int64_t first : lattice.first)
    origin_mm.push_back(static_cast<double>(first) * PackedLattice::kSpacing_mm);
  return {{"origin_mm", origin_mm}, {"spacing_mm", PackedLattice::kSpacing_mm}, {"size", lattice.size},
          {"nodes", lattice.nodes}, {"unit_mm", PackedLattice::kUnit_mm},       {"phases", lattice.phases}};
}

PageJson add_motion(const ExportRequest& session, const std::optional<PackedKeys>& keys, Parts& parts) {
  if (!keys) return {};
  const KeyMaps& maps = *session.map->keys;
  parts.add("keys", keys->others);
  PageJson modes = PageJson::array(), rows = PageJson::array(), ranges = PageJson::array();
  for (std::size_t m = 0; m < maps.phases().phases().size(); ++m)
    modes.push_back(mode_json(maps.phases().rhythm().modes()[m], maps.phases().phases()[m]));
  for (const auto& [base, first, count] : keys->rows) rows.push_back({base, first, count});
  const KeyTexels texels(maps, 0, drawn_geometry(*session.map), {}, {});  // as the page has to make them
  for (const LayerByteRange& range : texels.byte_ranges()) ranges.push_back({range.offset, range.scale});
  const BodyRequest& body = session.body;
  return {
      {"modes", modes},
      {"rows", rows},
      {"drawn_ranges", ranges},
      {"lattice", add_lattice(session, parts)},
      {"held", PageJson(body.phase)},
      {"speed", body.speed},
      {"gate", body.gate ? PageJson{{"mode", body.gate->mode}, {"phase", body.gate->phase}} : PageJson()}};
}

PageJson add_surface(const Surface& surface, const std::string& name, Parts& parts) {
  const PackedMesh mesh = pack_mesh(surface.mesh);
  parts.add(name + "_points", mesh.points);
  parts.add(name + "_triangles", mesh.triangles);
  return {{"points", surface.mesh.points_mm.size()},  {"triangles", surface.mesh.triangles.size()},
          {"unit_mm", PackedMesh::kUnit_mm},          {"ring", mesh.ring},
          {"is_closed", is_watertight(surface.mesh)}, {"mu_per_mm", surface.mu_per_mm},
          {"colour", list(surface.colour)},           {"tube_sides", surface.tube_sides}};
}

/// Catheters and objects that do not move.
PageJson add_catheters(const ExportRequest& session, Parts& parts) {
  PageJson catheters = PageJson::array();
  for (const auto& surfaces : {session.catheters, session.implants})
    for (const Surface& surface : surfaces)
      catheters.push_back(add_surface(surface, fmt::format("catheter_{}", catheters.size()), parts));
  return catheters;
}

/// An instrument as it is drawn, wherever it is.
PageJson instrument_json(const std::string& name, const SteeredInstruments::Instrument& look) {
  PageJson parts = PageJson::array();
  for (const InstrumentPart& part : instrument_parts(look))
    parts.push_back({{"mu_per_mm", part.mu_per_mm},
                     {"colour", list(part.colour)},
                     {"inner_radius_mm", part.inner_radius_mm}});
  return {{"name", shown_name(name)}, {"radius_mm", look.radius_mm}, {"parts", parts}};
}

/// Four digits behind the point are finer than a chart shows.
PageJson rounded(std::span<const HubLoad> loads, double HubLoad::*load, double times) {
  PageJson numbers = PageJson::array();
  for (const HubLoad& here : loads) numbers.push_back(std::round(here.*load * times * 1e4) / 1e4);
  return numbers;
}

PageJson add_run(const ExportRequest& session, Parts& parts) {
  if (!session.run) return {};
  constexpr double kUnit_mm = 0.01;
  const RecordedRun& run = *session.run;
  PageJson instruments = PageJson::array();
  for (const RecordedRun::Instrument& instrument : run.instruments) {
    for (std::size_t p = 0; p < instrument.parts.size(); ++p)
      parts.add(fmt::format("shapes_{}_{}", instruments.size(), p),
                pack_shapes(instrument.parts[p], kUnit_mm));
    PageJson json = instrument_json(instrument.name, instrument.look);
    json["force_N"] = rounded(instrument.loads, &HubLoad::force_N, 1);
    json["torque_mNm"] = rounded(instrument.loads, &HubLoad::torque_Nm, 1000);
    instruments.push_back(std::move(json));
  }
  return {{"pictures", run.pictures()},
          {"step_s", run.step_s},
          {"unit_mm", kUnit_mm},
          {"moves", moves(session)},
          {"instruments", std::move(instruments)}};
}

/// One that can be steered, with what its hub does besides.
PageJson steered_json(const InstrumentModel& model) {
  PageJson json = instrument_json(model.name(), drawn(model));
  if (model.balloon()) json["balloon_bar"] = model.max_inflation_bar();
  if (model.has_sheath()) json["sheath"] = {{"mm", model.max_release_mm()}, {"rings", model.stent()->rings}};
  if (model.has_coils()) json["coils"] = model.coils().size();
  return json;
}

PageJson instruments_json(const std::vector<InstrumentModel>& models) {
  PageJson instruments = PageJson::array();
  for (const InstrumentModel& model : models) instruments.push_back(steered_json(model));
  return instruments;
}

/// Of what balloons and stents consist, by DeviceMatter.
PageJson matters_json() {
  PageJson matters = PageJson::array();
  for (int matter = 0; matter < kDeviceMatters; ++matter) {
    const DeviceMaterial& material = material_of(static_cast<DeviceMatter>(matter));
    matters.push_back({{"mu_per_mm", material.mu_per_mm},
                       {"colour", list(material.colour)},
                       {"tube_sides", material.tube_sides}});
  }
  return matters;
}

PageJson add_live(const ExportRequest& session, Parts& parts) {
  if (!session.live) return {};
  PageJson contrast = add_surface(session.live->contrast, "contrast", parts);
  contrast["drum_points"] = ContrastSurface::kDrumPoints;
  contrast["drum_triangles"] = ContrastSurface::kDrumTriangles;
  return {{"instruments", instruments_json(session.live->instruments)},
          {"contrast", std::move(contrast)},
          {"matters", matters_json()},
          {"has_hub", session.live->has_hub},
          {"modes", session.live->modes},
          {"vessels", session.live->vessels}};
}

/// Of an exercise, what its simulation takes behind the tree's numbers.
PageJson add_exercise(const SteeredExercise& exercise, std::size_t number, Parts& parts) {
  parts.add("exercise_" + std::to_string(number), packed_use(exercise.setup));
  PageJson targets = PageJson::array();
  for (const ExerciseTarget& target : exercise.exercise.targets) {
    const TargetMark mark = mark_of(target, *exercise.setup.tree);
    targets.push_back({{"name", target.name}, {"at_mm", list(mark.at_mm)}, {"radius_mm", mark.radius_mm}});
  }
  const auto& entry_mm = exercise.setup.entry.position_mm;
  return {{"title", exercise.exercise.title},
          {"task", exercise.exercise.task},
          {"choices", instruments_json(exercise.setup.choices)},
          {"used", exercise.setup.used},
          {"entry_mm", list({entry_mm.x(), entry_mm.y(), entry_mm.z()})},
          {"targets", std::move(targets)}};
}

/// What the page's own simulation takes, and how each instrument that may be chosen is drawn.
PageJson add_trainer(const ExportRequest& session, Parts& parts) {
  if (!session.trainer) return {};
  const std::vector<double> setup = packed(*session.trainer);
  parts.add("trainer", setup);
  const FluoroscopyOptions& fluoroscope = session.fluoroscope;
  parts.add("fluoroscope", packed(fluoroscope_setup(fluoroscope, water_per_mm(session.map->opacity()))));
  PageJson exercises = PageJson::array();
  for (const SteeredExercise& exercise : session.exercises)
    exercises.push_back(add_exercise(exercise, exercises.size(), parts));
  return {{"choices", instruments_json(session.trainer->choices)},
          {"used", session.trainer->used},
          {"pulses_per_s", fluoroscope.pulses_per_s},
          {"dose", static_cast<int>(fluoroscope.dose)},
          {"compression", fluoroscope.range_compression()},
          {"tree_numbers", setup.size() - packed_use(*session.trainer).size()},
          {"exercises", std::move(exercises)}};
}

PageJson window_to_json(const GreyWindow& window) {
  return {{"scale", window.scale}, {"dark", window.dark}, {"light", window.light}};
}

/// What the viewer's C-arm can do, and how it draws, so that the page does the same.
PageJson viewer_json() {
  constexpr double kDegrees = 180 / std::numbers::pi;
  PageJson presets = PageJson::array();
  for (const CArmPreset& preset : kCArmPresets)
    presets.push_back({{"name", preset.name}, {"lao_deg", preset.angle_deg}});
  return {{"presets", presets},
          {"least_zoom", CArmPose::kMinZoom},
          {"most_zoom", CArmPose::kMaxZoom},
          {"most_tilt_deg", CArmPose::kMaxTilt_rad * kDegrees},
          {"road_map_colour", {kRoadMapColour.x, kRoadMapColour.y, kRoadMapColour.z}}};
}

PageJson header_of(const ExportRequest& session, Parts& parts) {
  constexpr double kDegrees = 180 / std::numbers::pi;
  const CArmPose& pose = session.pose;
  PageJson header{{"format", kFormat}, {"title", session.title}};
  header["viewer"] = viewer_json();
  std::optional<PackedKeys> keys;
  if (moves(session)) keys = pack_keys(*session.map->keys, session.map->geometry);
  header["map"] = add_map(session, keys, parts);
  header["motion"] = add_motion(session, keys, parts);
  const bool is_steered = session.run || session.live;
  header["vessels"] = session.vessels ? add_surface(*session.vessels, "vessel", parts) : PageJson();
  header["catheters"] = add_catheters(session, parts);
  header["run"] = add_run(session, parts);
  header["live"] = add_live(session, parts);
  header["trainer"] = add_trainer(session, parts);
  header["pose"] = {{"lao_deg", pose.lao_rad * kDegrees},
                    {"cranial_deg", pose.cranial_rad * kDegrees},
                    {"zoom", pose.zoom},
                    {"table_mm", pose.table_mm},
                    {"left_mm", pose.across_mm.x},
                    {"back_mm", pose.across_mm.y}};
  header["cone"] = pose.cone ? PageJson{{"source_axis_mm", pose.cone->source_axis_mm},
                                        {"source_detector_mm", pose.cone->source_detector_mm}}
                             : PageJson();
  header["is_of_session"] = session.is_of_session;
  header["shows_vessels"] = session.vessels && session.shows_vessels && !is_steered;
  header["shows_road_map"] = session.vessels && (session.shows_road_map || is_steered);
  header["look"] = to_string(session.style.look);
  header["full_contrast"] = session.style.full_contrast || is_steered;  // as in `simulate --cine`
  header["window"] = session.has_window ? window_to_json(session.style.window) : PageJson();
  header["greys"] = {{"gamma", session.style.window.gamma}, {"inverted", session.style.window.inverted}};
  header["layer_weights"] = session.style.layer_weights;
  header["parts"] = parts.index();
  return header;
}

std::string_view embedded_page(std::string_view name) {
  for (const EmbeddedFile& file : embedded_pages())
    if (file.name == name) return file.source;
  return {};
}

}  // namespace

std::string web_page(const ExportRequest& session) {
  Parts parts;
  const PageJson header = header_of(session, parts);
  const View pose{.lao_rad = session.pose.lao_rad, .cranial_rad = session.pose.cranial_rad};
  // Of a body that moves the smallest takes six times as long, and is 3 % smaller.
  const int level = moves(session) ? 7 : 9;
  const bool simulates = session.trainer.has_value(), is_served = session.live && !simulates;
  const std::array<std::pair<std::string_view, std::string>, 8> values{
      {{"title", in_html(session.title)},
       {"connects", is_served   ? "; connect-src 'self'"
                    : simulates ? "; worker-src blob:"
                                : ""},
       {"evaluates", simulates ? " 'wasm-unsafe-eval'" : ""},
       {"simulation", simulates ? std::string(embedded_page("simulation.txt")) : ""},
       {"still-label", label(pose)},
       {"still", to_base64(session.still_png)},
       {"header", in_script(header)},
       {"data", to_base64(deflated(parts.bytes(), level))}}};
  return filled(embedded_page("page.html"), values);
}

}  // namespace xraycast
