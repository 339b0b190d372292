#include "xraycast/body_map.hpp"

#include "xraycast/error.hpp"
#include "xraycast/image.hpp"
#include "xraycast/image_output.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace xraycast {
namespace {

constexpr int kVersion = 1;

using nlohmann::json;

json centres_to_json(const std::vector<glm::dvec2>& centres) {
  json list = json::array();
  for (const glm::dvec2& centre : centres) list.push_back({centre.x, centre.y});
  return list;
}

/// Numbers travel as JSON text: EXR's own float attributes would round them to 32 bits.
OIIO::ImageSpec spec_of_layer(const BodyMap& map, int layer) {
  const MapGeometry& geometry = map.geometry;
  OIIO::ImageSpec spec(geometry.width, geometry.height, 1, OIIO::TypeDesc::FLOAT);
  spec.channelnames = {"tau"};
  spec.attribute("oiio:subimagename", fmt::format("layer {}", layer));
  spec.attribute("compression", "zips");
  spec.attribute("xraycast:version", kVersion);
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
    geometry.projection = projection_named(spec.get_string_attribute("xraycast:projection"));
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
  validate(geometry, path);
  return geometry;
}

}  // namespace

void write_body_map(const BodyMap& map, const std::filesystem::path& path) {
  std::vector<ImagePart> parts;
  for (int k = 0; k < map.geometry.layers(); ++k)
    parts.push_back({spec_of_layer(map, k), map.layer(k).data()});
  write_image_file(parts, "openexr", path);
}

BodyMap read_body_map(const std::filesystem::path& path) {
  const std::string name = path.string();
  const auto in = OIIO::ImageInput::open(name);
  if (!in) throw InputError("{}: cannot be opened as an image: {}", name, OIIO::geterror());
  const OIIO::ImageSpec& first = in->spec();
  const int version = first.get_int_attribute("xraycast:version", 0);
  if (version == 0) throw InputError("{}: not a body map; make one with `xraycast cast`", name);
  if (version != kVersion)
    throw InputError("{}: body map of version {}, but this program reads version {}", name, version,
                     kVersion);

  BodyMap map;
  map.geometry = geometry_of(first, name);
  map.opacity = Opacity::from_json(first.get_string_attribute("xraycast:opacity"),
                                   name + ": attribute xraycast:opacity");
  map.source = first.get_string_attribute("xraycast:source");
  for (int k = 0; k < map.geometry.layers(); ++k) {
    if (!in->seek_subimage(k, 0))
      throw InputError("{}: layer {} of {} is missing", name, k, map.geometry.layers());
    const OIIO::ImageSpec& spec = in->spec();
    if (spec.width != map.geometry.width || spec.height != map.geometry.height || spec.nchannels != 1)
      throw InputError("{}: layer {} has another size than layer 0", name, k);
    map.tau.resize((k + 1) * map.layer_size());
    if (!in->read_image(k, 0, 0, 1, OIIO::TypeDesc::FLOAT, map.tau.data() + k * map.layer_size()))
      throw InputError("{}: layer {} is damaged: {}", name, k, in->geterror());
  }
  if (!std::ranges::all_of(map.tau, [](float t) { return std::isfinite(t) && t >= 0; }))
    throw InputError("{}: tau has values that are negative or not finite", name);
  return map;
}

void write_preview(const BodyMap& map, PreviewWindow window, const std::filesystem::path& path) {
  // Every layer has its own window, but one that holds next to nothing must not look like one that holds
  // bones.
  constexpr double kFaintest = 0.2;
  double deepest = 0;
  for (int k = 0; k < map.geometry.layers(); ++k) deepest = std::max(deepest, typical_depth(map.layer(k)));
  std::vector<std::uint8_t> rgb;
  for (int k = 0; k < map.geometry.layers(); ++k) {
    const auto greys = window == PreviewWindow::paper
                           ? plain_transmission(map.layer(k))
                           : windowed_transmission(map.layer(k), kFaintest * deepest);
    for (const std::uint8_t grey : greys) rgb.insert(rgb.end(), 3, grey);
  }
  write_png(rgb, map.geometry.width, map.geometry.height * map.geometry.layers(), 3, path);
}

}  // namespace xraycast
