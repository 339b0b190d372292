#include "xraycast/casting/body_map.hpp"

#include "xraycast/base/dicom_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/image.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/base/small_pictures.hpp"
#include "xraycast/casting/key_maps_file.hpp"
#include "xraycast/casting/outline_bands.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

// The version determines the channels, or that an outline follows the layers; from kPrecisionVersion on
// attributes do.
constexpr int kTauVersion = 1, kSpectrumVersion = 2, kOutlineVersion = 3, kPrecisionVersion = 4,
              kMotionVersion = 5;
constexpr const char *kOutlinePart = "outline", *kOutlineChannel = "radius_mm";

using nlohmann::json;

/// The channels of a map, by their names in the file. `Map` is BodyMap or const BodyMap, and so are the
/// values.
template <typename Map>
auto channels_of(Map& map) {
  std::vector<std::pair<const char*, decltype(&map.tau)>> channels;
  if (map.spectrum())
    for (std::size_t m = 0; m < kMaterials.size(); ++m)
      channels.emplace_back(kMaterials[m].name, &map.depths[m]);
  else
    channels.emplace_back("tau", &map.tau);
  return channels;
}

template <typename Map>
std::vector<std::string> channel_names(Map& map) {
  std::vector<std::string> names;
  for (const auto& [name, values] : channels_of(map)) names.emplace_back(name);
  return names;
}

int version_of(const BodyMap& map) {
  if (map.keys) return kMotionVersion;
  if (map.precision != MapPrecision::float32) return kPrecisionVersion;
  return map.geometry.has_outline() ? kOutlineVersion : map.spectrum() ? kSpectrumVersion : kTauVersion;
}

/// A map's values as its file stores them: of every channel K x H x W.
struct StoredValues {
  std::vector<std::span<const float>> channels{};
  json byte_ranges{};  ///< of every channel: the offset and the scale of each layer
  std::vector<std::vector<float>> bytes{};
};

/// The ranges of the key maps' bytes; their values are stored by key_parts.
StoredValues stored_ranges(const BodyMap& map) {
  StoredValues stored;
  for (std::size_t c = 0; const std::string& name : channel_names(map))
    for (const LayerByteRange& range : map.keys->ranges()[c++])
      stored.byte_ranges[name].push_back({range.offset, range.scale});
  return stored;
}

StoredValues stored_values(const BodyMap& map) {
  if (map.keys) return stored_ranges(map);
  StoredValues stored;
  for (const auto& [name, values] : channels_of(map)) {
    if (map.precision != MapPrecision::byte) {
      stored.channels.emplace_back(*values);
      continue;
    }
    std::vector<float> bytes;
    bytes.reserve(values->size());
    for (int layer = 0; layer < map.geometry.layers(); ++layer) {
      const auto of_layer = std::span(*values).subspan(layer * map.layer_size(), map.layer_size());
      const LayerByteRange range = byte_range_of(of_layer);
      for (const float value : of_layer) bytes.push_back(range.byte_of(value));
      stored.byte_ranges[name].push_back({range.offset, range.scale});
    }
    stored.channels.emplace_back(stored.bytes.emplace_back(std::move(bytes)));
  }
  return stored;
}

json centres_to_json(const std::vector<glm::dvec2>& centres) {
  json list = json::array();
  for (const glm::dvec2& centre : centres) list.push_back({centre.x, centre.y});
  return list;
}

/// Numbers travel as JSON text: EXR's own float attributes would round them to 32 bits.
ExrPart part_of_layer(const BodyMap& map, const StoredValues& stored, int layer) {
  const MapGeometry& geometry = map.geometry;
  ExrPart part{.name = fmt::format("layer {}", layer),
               .width = geometry.width,
               .height = geometry.height,
               .is_half = map.precision != MapPrecision::float32,
               .is_packed_by_row = map.precision == MapPrecision::float32};
  const auto channels = channels_of(map);
  for (std::size_t c = 0; c < stored.channels.size(); ++c)
    part.channels[channels[c].first] = stored.channels[c].subspan(layer * map.layer_size(), map.layer_size());
  const auto set = [&](const std::string& name, std::variant<int, std::string> value) {
    part.attributes["xraycast:" + name] = std::move(value);
  };
  set("version", version_of(map));
  if (map.precision != MapPrecision::float32) {
    set("precision", to_string(map.precision));
    set("outline", geometry.has_outline() ? 1 : 0);
  }
  if (!stored.byte_ranges.empty()) set("byte_ranges", stored.byte_ranges.dump());
  set("projection", to_string(geometry.ray_layout));
  set("radii_mm", json(geometry.radii_mm).dump());
  set("centre_mm", centres_to_json(geometry.centre_mm).dump());
  if (geometry.ray_layout == RayLayout::sphere) set("centre_z_mm", json(geometry.centre_z_mm).dump());
  if (geometry.ray_layout == RayLayout::rectangle) set("views", json(geometry.views).dump());
  set("top_mm", json(geometry.top_mm).dump());
  set("row_spacing_mm", json(geometry.row_spacing_mm).dump());
  set("step_mm", json(geometry.step_mm).dump());
  if (geometry.field) set("field_mm", json(geometry.field->corners_mm()).dump());
  set(map.spectrum() ? "spectrum" : "opacity",
      std::visit([](const auto& one) { return one.to_json(); }, map.attenuation));
  set("source", map.source);
  if (!map.frame_of_reference_uid.empty()) set("frame_of_reference_uid", map.frame_of_reference_uid);
  set("layer", layer);
  return part;
}

/// The outline of every row.
std::vector<float> outline_rows(const MapGeometry& geometry) {
  std::vector<float> rows = geometry.outline_mm;
  while (rows.size() < static_cast<std::size_t>(geometry.width) * geometry.height)
    rows.insert(rows.end(), geometry.outline_mm.begin(), geometry.outline_mm.end());
  return rows;
}

/// The outline behind the layers: one row of it where all are the same.
std::vector<float> read_outline(const ExrReader& file, const MapGeometry& geometry, int part,
                                const std::string& path) {
  if (file.parts() <= part) throw InputError("{}: its part {} is missing", path, kOutlinePart);
  if (file.size(part) != file.size(0))
    throw InputError("{}: part {} has {} x {} radii for layers of {} x {} texels", path, kOutlinePart,
                     file.size(part).x, file.size(part).y, geometry.width, geometry.height);
  const auto width = static_cast<std::ptrdiff_t>(geometry.width);
  std::vector<float> rows(static_cast<std::size_t>(width) * geometry.height);
  file.read(part, false, {{kOutlineChannel, rows}});
  bool are_alike = geometry.ray_layout == RayLayout::cylinder;
  for (auto row = rows.begin() + width; are_alike && row != rows.end(); row += width)
    are_alike = std::equal(row, row + width, rows.begin());
  if (are_alike) rows.resize(static_cast<std::size_t>(width));
  return rows;
}

/// An xraycast attribute as JSON, or an InputError that names it.
json attribute(const ExrReader& file, const std::string& name, const std::string& path) {
  json value = parse_json(file.text("xraycast:" + name), path);
  if (value.is_discarded())
    throw InputError("{}: attribute xraycast:{} is missing or damaged; cast the map again", path, name);
  return value;
}

MapGeometry geometry_of(const ExrReader& file, const std::string& path) {
  MapGeometry geometry;
  try {
    geometry.ray_layout = parse_ray_layout(file.text("xraycast:projection"));
  } catch (const InputError& error) {
    throw InputError("{}: attribute xraycast:projection: {}", path, error.what());
  }
  geometry.width = file.size(0).x;
  geometry.height = file.size(0).y;
  const auto read = [&](const char* name, auto& value) {
    try {
      attribute(file, name, path).get_to(value);
    } catch (const json::exception&) {
      throw InputError("{}: attribute xraycast:{} is invalid; cast the map again", path, name);
    }
  };
  std::vector<std::array<double, 2>> centres;
  read("radii_mm", geometry.radii_mm);
  read("centre_mm", centres);
  read("top_mm", geometry.top_mm);
  read("row_spacing_mm", geometry.row_spacing_mm);
  read("step_mm", geometry.step_mm);
  if (geometry.ray_layout == RayLayout::sphere) read("centre_z_mm", geometry.centre_z_mm);
  if (geometry.ray_layout == RayLayout::rectangle) {
    const auto views = whole_number(attribute(file, "views", path));
    if (!views || !std::in_range<int>(*views))
      throw InputError("{}: attribute xraycast:views is not a number of views", path);
    geometry.views = static_cast<int>(*views);
  }
  for (const auto& [x, y] : centres) geometry.centre_mm.emplace_back(x, y);
  if (!file.text("xraycast:field_mm").empty()) {
    FieldOfView::Corners corners_mm{};
    read("field_mm", corners_mm);
    geometry.field = FieldOfView::between(corners_mm);
  }
  validate(geometry, path);
  return geometry;
}

MapPrecision precision_of(const ExrReader& file, int version, const std::string& path) {
  if (version < kPrecisionVersion) return MapPrecision::float32;
  try {
    return parse_map_precision(file.text("xraycast:precision"));
  } catch (const InputError& error) {
    throw InputError("{}: attribute xraycast:precision: {}; cast the map again", path, error.what());
  }
}

/// The offset and the scale of every layer of a channel.
std::vector<LayerByteRange> byte_ranges_of(const json& attribute, const char* channel, int layers,
                                           const std::string& path) {
  std::vector<std::array<float, 2>> pairs;
  try {
    attribute.at(channel).get_to(pairs);
  } catch (const json::exception&) {
    pairs.clear();
  }
  std::vector<LayerByteRange> ranges;
  for (const auto& [offset, scale] : pairs)
    if (std::isfinite(offset) && offset >= 0 && std::isfinite(scale) && scale >= 0)
      ranges.push_back({offset, scale});
  if (std::ssize(ranges) != layers || ranges.size() != pairs.size())
    throw InputError(
        "{}: attribute xraycast:byte_ranges must hold an offset and a scale, neither negative, of {} for "
        "each of the {} layers; cast the map again",
        path, channel, layers);
  return ranges;
}

/// Of every channel and layer.
std::vector<std::vector<LayerByteRange>> byte_ranges_of(const BodyMap& map, const ExrReader& file,
                                                        const std::string& path) {
  const json ranges_of_channels = attribute(file, "byte_ranges", path);
  std::vector<std::vector<LayerByteRange>> ranges;
  for (const auto& [channel, values] : channels_of(map))
    ranges.push_back(byte_ranges_of(ranges_of_channels, channel, map.geometry.layers(), path));
  return ranges;
}

/// Turns the bytes of a map's layers, as they were read, into values.
void expand_bytes(BodyMap& map, const ExrReader& file, const std::string& path) {
  const auto all_ranges = byte_ranges_of(map, file, path);
  for (std::size_t c = 0; const auto& [channel, values] : channels_of(map)) {
    if (!std::ranges::all_of(*values, [](float byte) { return byte >= 0 && byte <= 255; }))
      throw InputError("{}: {} has values that are not bytes; cast the map again", path, channel);
    const auto& ranges = all_ranges[c++];
    for (std::size_t i = 0; i < values->size(); ++i)
      (*values)[i] = ranges[i / map.layer_size()].value_of((*values)[i]);
  }
}

BodyMap read_map(const std::filesystem::path& path) {
  const std::string name = path.string();
  std::error_code error;
  if (std::filesystem::is_directory(path, error))
    throw InputError("{}: a folder, but a body map is needed; make one from a scan with `xraycast cast`",
                     name);
  if (!is_exr(path)) throw InputError("{}: not a body map; make one with `xraycast cast`", name);
  const ExrReader file(path);
  const int version = file.number("xraycast:version");
  if (version == 0) throw InputError("{}: not a body map; make one with `xraycast cast`", name);
  if (version < kTauVersion || version > kMotionVersion)
    throw InputError("{}: body map version {}, but this program reads versions {} to {}; {}", name, version,
                     kTauVersion, kMotionVersion,
                     version > kMotionVersion ? "use a newer xraycast" : "cast the scan again");

  BodyMap map;
  map.geometry = geometry_of(file, name);
  map.precision = precision_of(file, version, name);
  if (version == kSpectrumVersion || (version >= kOutlineVersion && !file.text("xraycast:spectrum").empty()))
    map.attenuation =
        Spectrum::from_json(file.text("xraycast:spectrum"), name + ": attribute xraycast:spectrum");
  else
    map.attenuation =
        Opacity::from_json(file.text("xraycast:opacity"), name + ": attribute xraycast:opacity");
  map.source = file.text("xraycast:source");
  map.frame_of_reference_uid = file.text("xraycast:frame_of_reference_uid");
  if (!map.frame_of_reference_uid.empty() && !is_dicom_uid(map.frame_of_reference_uid))
    throw InputError("{}: attribute xraycast:frame_of_reference_uid is not a DICOM UID; cast the map again",
                     name);
  const int layers = map.geometry.layers();
  const bool has_keys = version == kMotionVersion;
  if (file.parts() < layers) throw InputError("{}: layer {} of {} is missing", name, file.parts(), layers);
  std::shared_ptr<KeyMaps> keys;
  int outline_part = layers;
  if (has_keys)
    keys = std::make_shared<KeyMaps>(read_keys(file, map.geometry, channel_names(map),
                                               byte_ranges_of(map, file, name), path, outline_part));
  if (version == kOutlineVersion || file.number("xraycast:outline") != 0) {
    map.geometry.outline_mm = read_outline(file, map.geometry, outline_part, name);
    validate(map.geometry, name);
    check_reach(map.geometry, name);
  }
  if (has_keys) return moving_map(std::move(map), std::move(keys));
  for (int k = 0; k < layers; ++k)
    if (file.size(k) != file.size(0)) throw InputError("{}: layer {} differs in size from layer 0", name, k);

  const auto channels = channels_of(map);
  for (const auto& [channel, values] : channels) values->resize(layers * map.layer_size());
  parallel_for(layers, [&](std::int64_t k) {
    std::map<std::string, std::span<float>> targets;
    for (const auto& [channel, values] : channels)
      targets[channel] = std::span(*values).subspan(k * map.layer_size(), map.layer_size());
    file.read(static_cast<int>(k), map.precision != MapPrecision::float32, targets);
  });
  if (map.precision == MapPrecision::byte) expand_bytes(map, file, name);
  for (const auto& [channel, values] : channels)
    if (!std::ranges::all_of(*values, [](float v) { return std::isfinite(v) && v >= 0; }))
      throw InputError("{}: {} has values that are negative or not finite", name, channel);
  return map;
}

}  // namespace

bool fits_precision(const BodyMap& map) {
  if (map.precision != MapPrecision::float16) return true;
  return std::ranges::all_of(channels_of(map), [](const auto& channel) {
    return std::ranges::all_of(*channel.second, [](float value) { return value <= kLargestHalf; });
  });
}

void write_body_map(const BodyMap& map, const std::filesystem::path& path) {
  if (!fits_precision(map))
    throw InputError("{}: the map's values exceed 16-bit floats; store it in another precision",
                     path.string());
  const StoredValues stored = stored_values(map);
  std::vector<ExrPart> parts;
  KeyParts of_keys;
  if (map.keys) {
    of_keys = key_parts(map, channel_names(map), path);
    parts = std::move(of_keys.parts);
    parts.front().attributes.merge(part_of_layer(map, stored, 0).attributes);
  } else {
    for (int k = 0; k < map.geometry.layers(); ++k) parts.push_back(part_of_layer(map, stored, k));
  }
  std::vector<float> outline;
  if (map.geometry.has_outline()) {
    outline = outline_rows(map.geometry);
    parts.push_back({.name = kOutlinePart,
                     .width = map.geometry.width,
                     .height = map.geometry.height,
                     .channels = {{kOutlineChannel, outline}}});
  }
  write_exr(parts, path);
}

void check_map_name(const std::filesystem::path& path) {
  if (extension_of(path) != ".exr") throw InputError("{}: the file name must end in .exr", path.string());
}

BodyMap read_body_map(const std::filesystem::path& path) {
  return with_remedy(path, "cast the map again", [&] { return read_map(path); });
}

std::filesystem::path motion_named_by(const std::filesystem::path& map) {
  return with_remedy(map, "cast the map again",
                     [&] { return absolute_motion(ExrReader(map).text("xraycast:motion"), map); });
}

std::vector<std::uint8_t> preview_of(const BodyMap& map, PreviewWindow window) {
  // Every layer has its own window, but an almost empty one must not look like one with bones.
  constexpr double kFaintest = 0.2;
  const std::vector<float> under_spectrum =
      map.spectrum() ? SpectrumModel(*map.spectrum()).tau(map.depths) : std::vector<float>{};
  const std::span<const float> tau = map.spectrum() ? under_spectrum : map.tau;
  const auto layer = [&](int k) { return tau.subspan(k * map.layer_size(), map.layer_size()); };
  double deepest = 0;
  for (int k = 0; k < map.geometry.layers(); ++k) deepest = std::max(deepest, typical_depth(layer(k)));
  std::vector<std::uint8_t> all;
  for (int k = 0; k < map.geometry.layers(); ++k) {
    const auto greys = window == PreviewWindow::paper ? plain_transmission(layer(k))
                                                      : windowed_transmission(layer(k), kFaintest * deepest);
    all.insert(all.end(), greys.begin(), greys.end());
  }
  return all;
}

}  // namespace xraycast
