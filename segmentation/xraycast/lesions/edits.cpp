#include "xraycast/lesions/edits.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/whole_file.hpp"

#include <nlohmann/json.hpp>

#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <string_view>

namespace xraycast {
namespace {

struct Side {
  const char* name;
  glm::dvec3 lps;
};

constexpr std::array<Side, 6> kSides{{{"left", {1, 0, 0}},
                                      {"right", {-1, 0, 0}},
                                      {"anterior", {0, -1, 0}},
                                      {"posterior", {0, 1, 0}},
                                      {"cranial", {0, 0, 1}},
                                      {"caudal", {0, 0, -1}}}};
constexpr std::array<const char*, 3> kPlaques{"soft", "calcium", "thrombus"};

/// The words between commas, without blanks around them.
std::vector<std::string> split_words(const std::string& text) {
  std::vector<std::string> words;
  std::size_t from = 0;
  for (;;) {
    const std::size_t comma = text.find(',', from);
    words.emplace_back(trimmed(std::string_view(text).substr(from, comma - from)));
    if (comma == std::string::npos) return words;
    from = comma + 1;
  }
}

double number_in(std::string_view word, const std::string& field) {
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value))
    throw InputError("{}: \"{}\" is not a number", field, word);
  return value;
}

std::optional<glm::dvec3> side_of(std::string_view word) {
  if (word == "eccentric") return glm::dvec3(0);
  constexpr std::string_view kFront = "eccentric=";
  if (!word.starts_with(kFront)) return {};
  for (const Side& side : kSides)
    if (word.substr(kFront.size()) == side.name) return side.lps;
  return {};
}

std::optional<PlaqueKind> plaque_of(std::string_view word) {
  for (std::size_t i = 0; i < kPlaques.size(); ++i)
    if (word == kPlaques[i]) return static_cast<PlaqueKind>(i);
  return {};
}

const char* name_of(PlaqueKind plaque) { return kPlaques[static_cast<std::size_t>(plaque)]; }

void check_edit(const StenosisEdit& edit, const std::string& field) {
  if (!(edit.length_mm > 0)) throw InputError("{}: its length must be above zero", field);
  if (!(edit.percent > 0 && edit.percent < 100))
    throw InputError(
        "{}: {:g} % must be above 0 and below 100; a vessel that is closed is removed with `remove`", field,
        edit.percent);
}

void check_edit(const AneurysmEdit& edit, const std::string& field) {
  if (!(edit.diameter_mm > 0 && edit.neck_mm > 0))
    throw InputError("{}: diameter and neck must be above zero", field);
  if (edit.neck_mm > edit.diameter_mm)
    throw InputError("{}: its neck of {:g} mm is wider than its diameter, {:g} mm", field, edit.neck_mm,
                     edit.diameter_mm);
}

void check_edit(const ScaleEdit& edit, const std::string& field) {
  if (!(edit.factor >= 0.05 && edit.factor <= 20))
    throw InputError("{}: the factor {:g} must be 0.05 to 20", field, edit.factor);
}

// ---- as JSON --------------------------------------------------------------------------------------------

using Object = nlohmann::ordered_json;

Object json_of_vector(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

/// An object of the list "edits".
struct EditFields {
  const nlohmann::json& object;
  std::string field;

  const nlohmann::json& member(const char* key) const {
    if (!object.is_object() || !object.contains(key)) throw InputError("{}: \"{}\" is missing", field, key);
    return object[key];
  }
  double number(const char* key) const {
    if (!member(key).is_number()) throw InputError("{}: \"{}\" is not a number", field, key);
    return object[key].get<double>();
  }
  std::string text(const char* key) const {
    const nlohmann::json& value = member(key);
    if (value.is_number_integer()) return value.dump();
    if (!value.is_string()) throw InputError("{}: \"{}\" is not text", field, key);
    return value.get<std::string>();
  }
  glm::dvec3 vector(const char* key) const {
    const nlohmann::json& value = member(key);
    if (!value.is_array() || value.size() != 3 || !value[0].is_number() || !value[1].is_number() ||
        !value[2].is_number())
      throw InputError("{}: \"{}\" is not [x, y, z]", field, key);
    return {value[0].get<double>(), value[1].get<double>(), value[2].get<double>()};
  }
};

StenosisEdit stenosis_of(const EditFields& fields) {
  StenosisEdit edit{.branch = fields.text("stenosis"),
                    .at_mm = fields.number("at_mm"),
                    .length_mm = fields.number("length_mm"),
                    .percent = fields.number("percent")};
  if (fields.object.contains("of")) {
    const std::string of = fields.text("of");
    if (of != "area" && of != "diameter")
      throw InputError("{}: \"of\" is neither \"diameter\" nor \"area\"", fields.field);
    edit.is_of_area = of == "area";
  }
  if (fields.object.contains("towards")) edit.towards = fields.vector("towards");
  if (fields.object.contains("plaque")) {
    const auto plaque = plaque_of(fields.text("plaque"));
    if (!plaque) throw InputError("{}: \"plaque\" is not soft, calcium or thrombus", fields.field);
    edit.plaque = *plaque;
  }
  check_edit(edit, fields.field);
  return edit;
}

void add_edit(const EditFields& fields, Edits& edits) {
  if (!fields.object.is_object()) throw InputError("{}: is not an object", fields.field);
  if (fields.object.contains("stenosis")) {
    edits.stenoses.push_back(stenosis_of(fields));
  } else if (fields.object.contains("aneurysm")) {
    edits.aneurysms.push_back({.point_mm = fields.vector("aneurysm"),
                               .diameter_mm = fields.number("diameter_mm"),
                               .neck_mm = fields.number("neck_mm")});
    check_edit(edits.aneurysms.back(), fields.field);
  } else if (fields.object.contains("remove")) {
    edits.removed.push_back(fields.text("remove"));
  } else if (fields.object.contains("scale")) {
    edits.scales.push_back({.what = fields.text("scale"), .factor = fields.number("factor")});
    check_edit(edits.scales.back(), fields.field);
  } else {
    throw InputError("{}: has none of \"stenosis\", \"aneurysm\", \"remove\" and \"scale\"", fields.field);
  }
}

}  // namespace

StenosisEdit stenosis_of(const std::string& words) {
  const std::string field = "`stenosis` " + words;
  const std::vector<std::string> parts = split_words(words);
  if (parts.size() < 4)
    throw InputError("{}: must be BRANCH,AT_MM,LENGTH_MM,PERCENT, such as \"left renal artery,12,10,60\"",
                     field);
  StenosisEdit edit{
      .branch = parts[0], .at_mm = number_in(parts[1], field), .length_mm = number_in(parts[2], field)};
  std::string percent = parts[3];
  if (edit.is_of_area = percent.ends_with('a'); edit.is_of_area) percent.pop_back();
  edit.percent = number_in(percent, field);
  for (auto word = parts.begin() + 4; word != parts.end(); ++word) {
    if (const auto side = side_of(*word))
      edit.towards = side;
    else if (const auto plaque = plaque_of(*word))
      edit.plaque = *plaque;
    else
      throw InputError(
          "{}: \"{}\" is none of eccentric, eccentric=left (right, anterior, posterior, cranial, caudal), "
          "calcium, thrombus",
          field, *word);
  }
  check_edit(edit, field);
  return edit;
}

AneurysmEdit aneurysm_of(const std::string& words) {
  const std::string field = "`aneurysm` " + words;
  const std::vector<std::string> parts = split_words(words);
  if (parts.size() != 5) throw InputError("{}: must be X,Y,Z,DIAMETER_MM,NECK_MM, in mm", field);
  std::array<double, 5> n{};
  for (std::size_t i = 0; i < n.size(); ++i) n[i] = number_in(parts[i], field);
  const AneurysmEdit edit{.point_mm = {n[0], n[1], n[2]}, .diameter_mm = n[3], .neck_mm = n[4]};
  check_edit(edit, field);
  return edit;
}

ScaleEdit scale_of(const std::string& words) {
  const std::string field = "`scale` " + words;
  const std::vector<std::string> parts = split_words(words);
  if (parts.size() != 2)
    throw InputError("{}: must be BRANCH,FACTOR, radii,FACTOR or size,FACTOR, such as radii,0.9", field);
  ScaleEdit edit{.what = parts[0], .factor = number_in(parts[1], field)};
  check_edit(edit, field);
  return edit;
}

Edits read_edits(const std::filesystem::path& file) {
  const nlohmann::json document = parse_edited_json(read_whole_file(file), file.string());
  if (!document.is_object() || !document.contains("edits") || !document["edits"].is_array())
    throw InputError("{}: \"edits\" is not a list; give the edits.json of an edited folder", file.string());
  Edits edits;
  int number = 0;
  for (const nlohmann::json& object : document["edits"])
    add_edit({object, fmt::format("{}: edit {}", file.string(), number++)}, edits);
  return edits;
}

std::string edits_text(const Edits& edits) {
  Object list = Object::array();
  for (const StenosisEdit& edit : edits.stenoses) {
    Object object{{"stenosis", edit.branch},
                  {"at_mm", edit.at_mm},
                  {"length_mm", edit.length_mm},
                  {"percent", edit.percent},
                  {"of", edit.is_of_area ? "area" : "diameter"}};
    if (edit.towards) object["towards"] = json_of_vector(*edit.towards);
    object["plaque"] = name_of(edit.plaque);
    list.push_back(std::move(object));
  }
  for (const AneurysmEdit& edit : edits.aneurysms)
    list.push_back({{"aneurysm", json_of_vector(edit.point_mm)},
                    {"diameter_mm", edit.diameter_mm},
                    {"neck_mm", edit.neck_mm}});
  for (const std::string& branch : edits.removed) list.push_back({{"remove", branch}});
  for (const ScaleEdit& edit : edits.scales) list.push_back({{"scale", edit.what}, {"factor", edit.factor}});
  return list.dump();
}

}  // namespace xraycast
