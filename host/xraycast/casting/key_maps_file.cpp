#include "xraycast/casting/key_maps_file.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/parallel.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace xraycast {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

}  // namespace

std::string relative_motion(const fs::path& motion, const fs::path& file) {
  if (motion.empty()) return {};
  std::error_code error;
  const fs::path absolute = fs::absolute(motion, error);
  const fs::path relative = absolute.lexically_relative(fs::absolute(file, error).parent_path());
  const bool is_near = !relative.empty() && !relative.string().starts_with("../../..");
  return (is_near ? relative : absolute).generic_string();
}

fs::path absolute_motion(const std::string& motion, const fs::path& file) {
  return motion.empty() ? fs::path() : file.parent_path() / motion;
}

std::string key_rows_text(std::span<const KeyRows> rows) {
  json list = json::array();
  for (const auto& [base, first, count] : rows) list.push_back({base, first, count});
  return list.dump();
}

std::vector<KeyRows> parse_key_rows(const std::string& text, int keys, int height, const std::string& name) {
  std::vector<KeyRows> all;
  try {
    for (const auto& [base, first, count] : parse_json(text, name).get<std::vector<std::array<int, 3>>>())
      all.push_back({base, first, count});
  } catch (const json::exception&) {
    all.clear();
  }
  if (std::ssize(all) != keys)
    throw InputError("{} must have the rows of {} keys; cast the map again", name, keys);
  for (int k = 0; k < keys; ++k) {
    const auto& [base, first, count] = all[static_cast<std::size_t>(k)];
    // Rows that are not its own are looked up from base to base, which must come to an end.
    const bool is_whole = first == 0 && count == height, has_base = base >= 0 && base < k;
    if (!(has_base || (is_whole && base == -1)) || first < 0 || count < 0 || first > height - count)
      throw InputError("{}: {}, {}, {} of key {} is invalid; cast the map again", name, base, first, count,
                       k);
  }
  return all;
}

KeyParts key_parts(const BodyMap& map, const std::vector<std::string>& channels, const fs::path& path) {
  const KeyMaps& maps = *map.keys;
  const auto width = static_cast<std::size_t>(map.geometry.width);
  KeyParts made;
  std::vector<KeyRows> rows;
  for (const KeyMaps::Key& key : maps.keys())
    for (const auto& bytes : key.channels) made.floats.emplace_back(bytes.begin(), bytes.end());
  for (std::size_t k = 0; k < maps.keys().size(); ++k) {
    const KeyRows& own = maps.keys()[k].rows;
    rows.push_back(own);
    const std::size_t of_layer = width * static_cast<std::size_t>(own.count);
    for (int layer = 0; own.count > 0 && layer < map.geometry.layers(); ++layer) {
      ExrPart& part = made.parts.emplace_back(ExrPart{.name = fmt::format("key {} layer {}", k, layer),
                                                      .width = map.geometry.width,
                                                      .height = own.count,
                                                      .first_row = own.first,
                                                      .all_rows = map.geometry.height,
                                                      .is_half = true});
      for (std::size_t c = 0; c < channels.size(); ++c)
        part.channels[channels[c]] =
            std::span(made.floats[k * channels.size() + c]).subspan(layer * of_layer, of_layer);
    }
  }
  auto& attributes = made.parts.front().attributes;
  attributes["xraycast:keys"] = maps.phases().to_json();
  attributes["xraycast:key_rows"] = key_rows_text(rows);
  attributes["xraycast:motion"] = relative_motion(maps.motion, path);
  return made;
}

KeyMaps read_keys(const ExrReader& file, const MapGeometry& geometry,
                  const std::vector<std::string>& channels, std::vector<std::vector<LayerByteRange>> ranges,
                  const fs::path& path, int& parts) {
  const std::string name = path.string();
  KeyPhases phases = KeyPhases::from_json(file.text("xraycast:keys"), name + ": attribute xraycast:keys");
  const std::vector<KeyRows> rows = parse_key_rows(file.text("xraycast:key_rows"), phases.count(),
                                                   geometry.height, name + ": attribute xraycast:key_rows");
  const int layers = geometry.layers();
  parts = layers *
          static_cast<int>(std::ranges::count_if(rows, [](const KeyRows& own) { return own.count > 0; }));
  if (file.parts() < parts)
    throw InputError("{}: layers of its key maps are missing; cast the map again", name);

  std::vector<KeyMaps::Key> keys;
  std::vector<int> first_part;
  for (int part = 0; const KeyRows& own : rows) {
    first_part.push_back(part);
    if (own.count == 0) {
      keys.push_back({own, std::vector<std::vector<std::uint8_t>>(channels.size())});
      continue;
    }
    for (int layer = 0; layer < layers; ++layer, ++part)
      if (file.size(part) != glm::ivec2(geometry.width, own.count))
        throw InputError("{}: part {} has {} x {} texels for {} x {}; cast the map again", name, part,
                         file.size(part).x, file.size(part).y, geometry.width, own.count);
    const std::size_t values = static_cast<std::size_t>(layers) * geometry.width * own.count;
    keys.push_back(
        {own, std::vector<std::vector<std::uint8_t>>(channels.size(), std::vector<std::uint8_t>(values))});
  }
  parallel_for(std::ssize(keys) * layers, [&](std::int64_t i) {
    KeyMaps::Key& key = keys[static_cast<std::size_t>(i / layers)];
    if (key.rows.count == 0) return;
    const std::size_t of_layer = static_cast<std::size_t>(geometry.width) * key.rows.count;
    std::vector<std::vector<float>> floats(channels.size(), std::vector<float>(of_layer));
    std::map<std::string, std::span<float>> targets;
    for (std::size_t c = 0; c < channels.size(); ++c) targets[channels[c]] = floats[c];
    file.read(first_part[static_cast<std::size_t>(i / layers)] + static_cast<int>(i % layers), true, targets);
    for (std::size_t c = 0; c < channels.size(); ++c)
      for (std::size_t t = 0; t < of_layer; ++t) {
        const float value = floats[c][t];
        if (!(value >= 0 && value <= 255))
          throw InputError("{}: {} has values that are not bytes; cast the map again", name, channels[c]);
        key.channels[c][static_cast<std::size_t>(i % layers) * of_layer + t] =
            static_cast<std::uint8_t>(value);
      }
  });
  KeyMaps maps(std::move(phases), geometry, std::move(keys), std::move(ranges));
  maps.motion = absolute_motion(file.text("xraycast:motion"), path);
  return maps;
}

}  // namespace xraycast
