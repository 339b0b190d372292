#include "xraycast/scene/session_file.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/coaxial/instruments.hpp"

#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace xraycast {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kVersion = 1;
constexpr double kDegrees = 180 / std::numbers::pi;

/// Names and places of the session's files.
template <typename Session>
auto files_of(Session& session) {
  return std::array{std::pair{"map", &session.map}, std::pair{"basis", &session.basis},
                    std::pair{"scan", &session.scan}, std::pair{"vessels", &session.vessels},
                    std::pair{"catheter", &session.catheter}};
}

Json pose_to_json(const CArmPose& pose) {
  Json json{{"angle_deg", pose.lao_rad * kDegrees},
            {"tilt_deg", pose.cranial_rad * kDegrees},
            {"table_mm", pose.table_mm},
            {"zoom", pose.zoom}};
  if (pose.across_mm != glm::dvec2(0)) json["across_mm"] = {pose.across_mm.x, pose.across_mm.y};
  if (pose.cone) json["cone_mm"] = {pose.cone->source_axis_mm, pose.cone->source_detector_mm};
  return json;
}

/// One field of an object, or an InputError that names it.
class Fields {
 public:
  Fields(const nlohmann::json& json, std::string name) : json_(json), name_(std::move(name)) {
    if (!json.is_object()) throw InputError("{} is not an object", name_);
  }

  bool has(const char* field) const { return json_.contains(field); }
  Fields at(const char* field) const { return {value(field), name_ + ": " + field}; }

  template <typename Value>
  Value get(const char* field) const {
    try {
      return value(field).get<Value>();
    } catch (const nlohmann::json::exception&) {
      throw InputError("{}: {} has the wrong type", name_, field);
    }
  }

  double number(const char* field, double low, double high) const {
    const auto result = get<double>(field);
    if (!(result >= low && result <= high))
      throw InputError("{}: {} is {}, outside {:g} to {:g}", name_, field, result, low, high);
    return result;
  }

  /// A word that `parse` knows.
  template <typename Parse>
  auto word(const char* field, Parse parse) const {
    const auto text = get<std::string>(field);
    try {
      return parse(text);
    } catch (const InputError& error) {
      throw InputError("{}: {}: {}", name_, field, error.what());
    }
  }

  const std::string& name() const { return name_; }
  const nlohmann::json& json() const { return json_; }
  const nlohmann::json& value(const char* field) const {
    const auto found = json_.find(field);
    if (found == json_.end()) throw InputError("{}: {} is missing", name_, field);
    return *found;
  }

 private:
  const nlohmann::json& json_;
  std::string name_;
};

Json steered_to_json(const SteeredInstruments& steered) {
  Json instruments = Json::array();
  for (const SteeredInstruments::Instrument& instrument : steered.instruments) {
    Json nodes = Json::array();
    for (const glm::dvec3& node : instrument.nodes_mm) nodes.push_back({node.x, node.y, node.z});
    Json markers = Json::array();
    for (const MarkerModel& marker : instrument.markers)
      markers.push_back({{"material", marker.material},
                         {"from_tip_mm", marker.from_tip_mm},
                         {"length_mm", marker.length_mm},
                         {"thickness_mm", marker.thickness_mm}});
    instruments.push_back({{"nodes_mm", nodes},
                           {"radius_mm", instrument.radius_mm},
                           {"has_lumen", instrument.has_lumen},
                           {"markers", markers}});
  }
  return {{"devices", instruments}, {"road_map", steered.has_road_map}};
}

/// What older sessions lack is as usual; they do not say how long an instrument is, nor how wide its lumen.
std::vector<MarkerModel> markers_of(const Fields& fields, double radius_mm, bool has_lumen) {
  constexpr double kLongest_mm = 5000;
  if (!fields.has("markers")) return usual_markers(radius_mm, has_lumen ? 0.5 * radius_mm : 0, kLongest_mm);
  const nlohmann::json& list = fields.value("markers");
  if (!list.is_array()) throw InputError("{}: markers must be a list", fields.name());
  std::vector<MarkerModel> markers;
  for (const nlohmann::json& json : list) {
    const Fields marker(json, fmt::format("{}: markers[{}]", fields.name(), markers.size()));
    markers.push_back({.material = marker.get<std::string>("material"),
                       .from_tip_mm = marker.get<double>("from_tip_mm"),
                       .length_mm = marker.get<double>("length_mm"),
                       .thickness_mm = marker.get<double>("thickness_mm")});
  }
  check(markers, radius_mm, 0, kLongest_mm, fields.name());
  return markers;
}

SteeredInstruments::Instrument steered_instrument_of(const Fields& fields) {
  SteeredInstruments::Instrument instrument;
  for (const auto& [x, y, z] : fields.get<std::vector<std::array<double, 3>>>("nodes_mm"))
    instrument.nodes_mm.emplace_back(x, y, z);
  instrument.radius_mm = fields.number("radius_mm", 0.01, 100);
  instrument.has_lumen = !fields.has("has_lumen") || fields.get<bool>("has_lumen");
  instrument.markers = markers_of(fields, instrument.radius_mm, instrument.has_lumen);
  return instrument;
}

/// Older sessions have one catheter, whose fields are the simulation's.
SteeredInstruments steered_of(const Fields& fields) {
  SteeredInstruments steered;
  steered.has_road_map = fields.get<bool>("road_map");
  if (!fields.has("devices")) {
    steered.instruments.push_back(steered_instrument_of(fields));
    return steered;
  }
  const nlohmann::json& instruments = fields.value("devices");
  if (!instruments.is_array() || instruments.empty() || instruments.size() > Instruments::kMaxCount)
    throw InputError("{}: devices must be a list of one to {}", fields.name(), Instruments::kMaxCount);
  for (std::size_t d = 0; d < instruments.size(); ++d)
    steered.instruments.push_back(
        steered_instrument_of(Fields(instruments[d], fmt::format("{}: devices[{}]", fields.name(), d))));
  return steered;
}

CArmPose pose_of(const Fields& fields) {
  CArmPose pose;
  pose.lao_rad = fields.number("angle_deg", -360, 360) / kDegrees;
  pose.cranial_rad = fields.number("tilt_deg", -50.001, 50.001) / kDegrees;
  pose.table_mm = fields.number("table_mm", -1e4, 1e4);
  pose.zoom = fields.number("zoom", CArmPose::kMinZoom, CArmPose::kMaxZoom);
  if (fields.has("across_mm")) {
    const auto across_mm = fields.get<std::array<double, 2>>("across_mm");
    pose.across_mm = {across_mm[0], across_mm[1]};
    constexpr double kFarthest_mm = 1e4;
    if (!(glm::length(pose.across_mm) <= kFarthest_mm))
      throw InputError("{}: across_mm is {:g}, {:g}, which is farther than {:g} mm", fields.name(),
                       across_mm[0], across_mm[1], kFarthest_mm);
  }
  if (fields.has("cone_mm")) {
    const auto cone = fields.get<std::array<double, 2>>("cone_mm");
    pose.cone = Cone{cone[0], cone[1]};
  }
  return pose;
}

GreyWindow window_of(const Fields& fields) {
  const GreyWindow window{fields.number("scale", 1e-6, 1e6), fields.number("dark", 0, 1),
                          fields.number("light", 0, 1), fields.number("gamma", 0.1, 10),
                          fields.get<bool>("inverted")};
  if (!(window.light > window.dark))
    throw InputError("{}: light is {}, which is not above dark, {}", fields.name(), window.light,
                     window.dark);
  return window;
}

Style style_of(const Fields& fields) {
  Style style;
  style.look = fields.word("look", parse_look);
  style.sampling.compositing = fields.word("compositing", parse_compositing);
  style.sampling.reconstruction =
      fields.get<bool>("continuous") ? Reconstruction::linear : Reconstruction::constant;
  if (fields.has("wall_radius_mm"))
    style.sampling.wall_radius_mm = fields.number("wall_radius_mm", 1e-3, 1e4);
  style.full_contrast = fields.has("full_contrast") && fields.get<bool>("full_contrast");
  style.layer_weights = fields.get<std::vector<float>>("strengths");
  if (!std::ranges::all_of(style.layer_weights, [](float s) { return s >= 0 && s <= kMaxLayerWeight; }))
    throw InputError("{}: strengths must be 0 to {:g}", fields.name(), kMaxLayerWeight);
  return style;
}

std::map<std::string, double> instant_of(const Fields& fields) {
  std::map<std::string, double> instant;
  for (const auto& [mode, phase] : fields.json().items()) instant[mode] = fields.number(mode.c_str(), 0, 1);
  return instant;
}

/// Files are named relative to `folder`.
Json implants_to_json(const std::vector<ImplantRequest>& implants, const fs::path& folder) {
  const auto relative = [&](const fs::path& file) {
    return fs::absolute(file).lexically_relative(folder).string();
  };
  Json all = Json::array();
  for (const ImplantRequest& implant : implants) {
    Json json{{"surface", relative(implant.mesh)}, {"material", implant.material}};
    if (implant.g_cm3) json["density_g_cm3"] = *implant.g_cm3;
    if (!implant.pose.empty()) json["pose"] = relative(implant.pose);
    all.push_back(std::move(json));
  }
  return all;
}

std::vector<ImplantRequest> implants_of(const Fields& session, const fs::path& folder) {
  std::vector<ImplantRequest> implants;
  const auto place = [&](const Fields& fields, const char* name) {
    return (folder / fields.get<std::string>(name)).lexically_normal();
  };
  for (std::size_t i = 0; i < session.value("objects").size(); ++i) {
    const Fields fields(session.value("objects")[i], fmt::format("{}: objects[{}]", session.name(), i));
    ImplantRequest implant{place(fields, "surface"), fields.get<std::string>("material")};
    if (fields.has("density_g_cm3")) implant.g_cm3 = fields.number("density_g_cm3", 0.01, 25);
    if (fields.has("pose")) implant.pose = place(fields, "pose");
    implants.push_back(std::move(implant));
  }
  return implants;
}

ViewSession read_fields(const fs::path& path) {
  const std::string name = path.string();
  const nlohmann::json json = parse_json(read_whole_file(path), name);
  if (json.is_discarded() || !json.is_object() || !json.contains("xraycast_session"))
    throw InputError("{}: not a session; save one in the viewer with Ctrl+S", name);
  const Fields fields(json, name);
  if (const auto version = whole_number(fields.value("xraycast_session")); version != kVersion)
    throw InputError("{}: session version {}, but this program reads version {}; {}", name,
                     version ? std::to_string(*version) : "unknown", kVersion,
                     version.value_or(0) > kVersion ? "use a newer xraycast"
                                                    : "save the session again in the viewer with Ctrl+S");
  ViewSession session;
  if (fields.has("files")) {
    const Fields named = fields.at("files");
    for (const auto& [field, file] : files_of(session)) {
      if (!named.has(field)) continue;
      *file = (fs::absolute(path).parent_path() / named.get<std::string>(field)).lexically_normal();
      // A name may be too long for any file.
      if (std::error_code error; !fs::exists(*file, error))
        throw InputError("{}: its {} {} does not exist; put it there", name, field, excerpt(file->string()));
    }
  }
  if (fields.has("contrast_mg_ml"))
    session.contrast_mg_ml = fields.number("contrast_mg_ml", 0, kMaxContrast_mg_ml);
  if (fields.has("objects")) session.implants = implants_of(fields, fs::absolute(path).parent_path());
  if (fields.has("simulation")) session.steered = steered_of(fields.at("simulation"));
  session.pose = pose_of(fields.at("camera"));
  session.style = style_of(fields.at("style"));
  session.has_window = fields.has("window");
  if (session.has_window) session.style.window = window_of(fields.at("window"));
  if (fields.has("instant")) session.instant = instant_of(fields.at("instant"));
  if (fields.has("opacity")) session.opacity = Opacity::from_json(fields.value("opacity").dump(), name);
  return session;
}

}  // namespace

void write_session(const ViewSession& session, const fs::path& path) {
  Json json{{"xraycast_session", kVersion}};
  const fs::path folder = fs::absolute(path).parent_path();
  for (const auto& [name, file] : files_of(session))
    if (!file->empty()) json["files"][name] = fs::absolute(*file).lexically_relative(folder).string();
  json["contrast_mg_ml"] = session.contrast_mg_ml;
  if (!session.implants.empty()) json["objects"] = implants_to_json(session.implants, folder);
  if (session.steered) json["simulation"] = steered_to_json(*session.steered);
  json["camera"] = pose_to_json(session.pose);
  const Style& style = session.style;
  json["style"] = {{"look", to_string(style.look)},
                   {"compositing", to_string(style.sampling.compositing)},
                   {"continuous", style.sampling.reconstruction == Reconstruction::linear},
                   {"full_contrast", style.full_contrast},
                   {"strengths", style.layer_weights}};
  if (style.sampling.wall_radius_mm) json["style"]["wall_radius_mm"] = *style.sampling.wall_radius_mm;
  if (session.has_window)
    json["window"] = {{"scale", style.window.scale},
                      {"dark", style.window.dark},
                      {"light", style.window.light},
                      {"gamma", style.window.gamma},
                      {"inverted", style.window.inverted}};
  if (!session.instant.empty()) json["instant"] = session.instant;
  if (session.opacity) json["opacity"] = Json::parse(session.opacity->to_json());
  std::string text;
  try {
    text = json.dump(2) + "\n";
  } catch (const Json::exception&) {
    throw InputError("{}: the name of one of the session's files is not UTF-8; rename it", path.string());
  }
  write_whole_file(path, text);
}

ViewSession read_session(const fs::path& path) {
  return with_remedy(path, "save the session again in the viewer with Ctrl+S",
                     [&] { return read_fields(path); });
}

}  // namespace xraycast
