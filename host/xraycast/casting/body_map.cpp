#include "xraycast/casting/body_map.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/image.hpp"
#include "xraycast/base/image_output.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

// A version says which channels there are.
constexpr int kTauVersion = 1, kSpectrumVersion = 2;

using nlohmann::json;

/// What a map holds, by its name in the file. `Map` is BodyMap or const BodyMap, and so are the values.
template <typename Map>
auto channels_of(Map& map) {
  std::vector<std::pair<const char*, decltype(&map.tau)>> channels;
  if (map.spectrum)
    for (std::size_t m = 0; m < kMaterials.size(); ++m)
      channels.emplace_back(kMaterials[m].name, &map.depths[m]);
  else
    channels.emplace_back("tau", &map.tau);
  return channels;
}

json centres_to_json(const std::vector<glm::dvec2>& centres) {
  json list = json::array();
  for (const glm::dvec2& centre : centres) list.push_back({centre.x, centre.y});
  return list;
}

/// Numbers travel as JSON text: EXR's own float attributes would round them to 32 bits.
OIIO::ImageSpec spec_of_layer(const BodyMap& map, int layer) {
  const MapGeometry& geometry = map.geometry;
  const auto channels = channels_of(map);
  OIIO::ImageSpec spec(geometry.width, geometry.height, static_cast<int>(channels.size()),
                       OIIO::TypeDesc::FLOAT);
  spec.channelnames.clear();
  for (const auto& [name, values] : channels) spec.channelnames.emplace_back(name);
  spec.attribute("oiio:subimagename", fmt::format("layer {}", layer));
  spec.attribute("compression", "zips");
  spec.attribute("xraycast:version", map.spectrum ? kSpectrumVersion : kTauVersion);
  spec.attribute("xraycast:projection", to_string(geometry.projection));
  spec.attribute("xraycast:radii_mm", json(geometry.radii_mm).dump());
  spec.attribute("xraycast:centre_mm", centres_to_json(geometry.centre_mm).dump());
  if (geometry.projection == Projection::sphere)
    spec.attribute("xraycast:centre_z_mm", json(geometry.centre_z_mm).dump());
  if (geometry.projection == Projection::rectangle)
    spec.attribute("xraycast:views", json(geometry.views).dump());
  spec.attribute("xraycast:top_mm", json(geometry.top_mm).dump());
  spec.attribute("xraycast:row_spacing_mm", json(geometry.row_spacing_mm).dump());
  spec.attribute("xraycast:step_mm", json(geometry.step_mm).dump());
  if (geometry.field) spec.attribute("xraycast:field_mm", json(geometry.field->corners_mm()).dump());
  if (map.spectrum)
    spec.attribute("xraycast:spectrum", map.spectrum->to_json());
  else
    spec.attribute("xraycast:opacity", map.opacity.to_json());
  spec.attribute("xraycast:source", map.source);
  spec.attribute("xraycast:layer", layer);
  return spec;
}

/// One of our attributes as JSON, or an InputError that names it.
json attribute(const OIIO::ImageSpec& spec, const std::string& name, const std::string& path) {
  const std::string text = spec.get_string_attribute("xraycast:" + name);
  json value = json::parse(text, nullptr, false);
  if (value.is_discarded()) throw InputError("{}: attribute xraycast:{} is missing or damaged", path, name);
  return value;
}

MapGeometry geometry_of(const OIIO::ImageSpec& spec, const std::string& path) {
  MapGeometry geometry;
  try {
    geometry.projection = parse_projection(spec.get_string_attribute("xraycast:projection"));
  } catch (const InputError& error) {
    throw InputError("{}: attribute xraycast:projection: {}", path, error.what());
  }
  geometry.width = spec.width;
  geometry.height = spec.height;
  const auto read = [&](const char* name, auto& value) {
    try {
      attribute(spec, name, path).get_to(value);
    } catch (const json::exception&) {
      throw InputError("{}: attribute xraycast:{} is not what it should be", path, name);
    }
  };
  std::vector<std::array<double, 2>> centres;
  read("radii_mm", geometry.radii_mm);
  read("centre_mm", centres);
  read("top_mm", geometry.top_mm);
  read("row_spacing_mm", geometry.row_spacing_mm);
  read("step_mm", geometry.step_mm);
  if (geometry.projection == Projection::sphere) read("centre_z_mm", geometry.centre_z_mm);
  if (geometry.projection == Projection::rectangle) read("views", geometry.views);
  for (const auto& [x, y] : centres) geometry.centre_mm.emplace_back(x, y);
  if (spec.find_attribute("xraycast:field_mm")) {
    FieldOfView::Corners corners_mm{};
    read("field_mm", corners_mm);
    geometry.field = FieldOfView::between(corners_mm);
  }
  validate(geometry, path);
  return geometry;
}

/// The pixels of a layer, channel by channel in each.
std::vector<float> pixels_of_layer(const BodyMap& map, int layer) {
  const auto channels = channels_of(map);
  std::vector<float> pixels(channels.size() * map.layer_size());
  for (std::size_t c = 0; c < channels.size(); ++c)
    for (std::size_t i = 0; i < map.layer_size(); ++i)
      pixels[i * channels.size() + c] = (*channels[c].second)[layer * map.layer_size() + i];
  return pixels;
}

}  // namespace

void write_body_map(const BodyMap& map, const std::filesystem::path& path) {
  std::vector<std::vector<float>> pixels;
  std::vector<ImagePart> parts;
  for (int k = 0; k < map.geometry.layers(); ++k) {
    pixels.push_back(pixels_of_layer(map, k));
    parts.push_back({spec_of_layer(map, k), pixels.back().data()});
  }
  write_image_file(parts, "openexr", path);
}

BodyMap read_body_map(const std::filesystem::path& path) {
  const std::string name = path.string();
  const auto in = OIIO::ImageInput::open(name);
  if (!in) {
    OIIO::geterror();  // speaks of formats, and would be kept for the next call
    if (!std::filesystem::exists(path)) throw InputError("{}: no such file", name);
    throw InputError("{}: not a body map, or damaged; make one with `xraycast cast`", name);
  }
  const OIIO::ImageSpec& first = in->spec();
  const int version = first.get_int_attribute("xraycast:version", 0);
  if (version == 0) throw InputError("{}: not a body map; make one with `xraycast cast`", name);
  if (version != kTauVersion && version != kSpectrumVersion)
    throw InputError("{}: body map of version {}, but this program reads versions up to {}", name, version,
                     kSpectrumVersion);

  BodyMap map;
  map.geometry = geometry_of(first, name);
  if (version == kSpectrumVersion)
    map.spectrum = Spectrum::from_json(first.get_string_attribute("xraycast:spectrum"),
                                       name + ": attribute xraycast:spectrum");
  else
    map.opacity = Opacity::from_json(first.get_string_attribute("xraycast:opacity"),
                                     name + ": attribute xraycast:opacity");
  map.source = first.get_string_attribute("xraycast:source");
  for (int k = 0; k < map.geometry.layers(); ++k) {
    if (!in->seek_subimage(k, 0))
      throw InputError("{}: layer {} of {} is missing", name, k, map.geometry.layers());
    const OIIO::ImageSpec& spec = in->spec();
    if (spec.width != map.geometry.width || spec.height != map.geometry.height)
      throw InputError("{}: layer {} has another size than layer 0", name, k);
    for (const auto& [channel, values] : channels_of(map)) {
      const int index = spec.channelindex(channel);
      if (index < 0) throw InputError("{}: layer {} has no channel {}", name, k, channel);
      values->resize((k + 1) * map.layer_size());
      if (!in->read_image(k, 0, index, index + 1, OIIO::TypeDesc::FLOAT,
                          values->data() + k * map.layer_size()))
        throw InputError("{}: layer {} is damaged: {}", name, k, in->geterror());
    }
  }
  for (const auto& [channel, values] : channels_of(map))
    if (!std::ranges::all_of(*values, [](float v) { return std::isfinite(v) && v >= 0; }))
      throw InputError("{}: {} has values that are negative or not finite", name, channel);
  return map;
}

void write_preview(const BodyMap& map, PreviewWindow window, const std::filesystem::path& path) {
  // Every layer has its own window, but one that holds next to nothing must not look like one that holds
  // bones.
  constexpr double kFaintest = 0.2;
  const std::vector<float> under_spectrum =
      map.spectrum ? SpectrumModel(*map.spectrum).tau(map.depths) : std::vector<float>{};
  const std::span<const float> tau = map.spectrum ? under_spectrum : map.tau;
  const auto layer = [&](int k) { return tau.subspan(k * map.layer_size(), map.layer_size()); };
  double deepest = 0;
  for (int k = 0; k < map.geometry.layers(); ++k) deepest = std::max(deepest, typical_depth(layer(k)));
  std::vector<std::uint8_t> rgb;
  for (int k = 0; k < map.geometry.layers(); ++k) {
    const auto greys = window == PreviewWindow::paper ? plain_transmission(layer(k))
                                                      : windowed_transmission(layer(k), kFaintest * deepest);
    for (const std::uint8_t grey : greys) rgb.insert(rgb.end(), 3, grey);
  }
  write_png(rgb, map.geometry.width, map.geometry.height * map.geometry.layers(), 3, path);
}

}  // namespace xraycast
