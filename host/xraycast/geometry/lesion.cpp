#include "xraycast/geometry/lesion.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/whole_file.hpp"

#include <nlohmann/json.hpp>

#include <cmath>

namespace xraycast {
namespace {

using Object = nlohmann::ordered_json;

Object json_of_point(const glm::dvec3& p) { return {p.x, p.y, p.z}; }

Object json_of_lesion(const Lesion& lesion) {
  Object object{{"kind", lesion.sac ? "aneurysm" : "stenosis"},
                {"branch", lesion.branch},
                {"vessel", lesion.vessel},
                {"at_mm", lesion.at_mm},
                {"place_mm", json_of_point(lesion.place_mm)},
                {"length_mm", lesion.length_mm},
                {"reference_mm", lesion.reference_mm},
                {"least_mm", lesion.least_mm}};
  if (lesion.sac)
    object["sac"] = {{"branch", lesion.sac->branch},
                     {"centre_mm", json_of_point(lesion.sac->centre_mm)},
                     {"diameter_mm", lesion.sac->diameter_mm},
                     {"neck_mm", lesion.sac->neck_mm}};
  return object;
}

/// The members of a lesion's object; `field` names it in messages.
struct LesionFields {
  const nlohmann::json& object;
  std::string field;

  const nlohmann::json& member(const char* key) const {
    if (!object.is_object() || !object.contains(key))
      throw InputError("{}: \"{}\" is missing; edit the tree again", field, key);
    return object[key];
  }
  double number(const char* key) const {
    const nlohmann::json& value = member(key);
    if (!value.is_number() || !std::isfinite(value.get<double>()))
      throw InputError("{}: \"{}\" is not a number; edit the tree again", field, key);
    return value.get<double>();
  }
  double above_zero(const char* key) const {
    const double value = number(key);
    if (!(value > 0)) throw InputError("{}: \"{}\" is not above zero; edit the tree again", field, key);
    return value;
  }
  int branch() const {
    const auto value = whole_number(member("branch"));
    if (!value || *value < 0 || *value > 1'000'000'000)
      throw InputError("{}: \"branch\" is not a branch's number; edit the tree again", field);
    return static_cast<int>(*value);
  }
  glm::dvec3 point(const char* key) const {
    const nlohmann::json& value = member(key);
    if (!value.is_array() || value.size() != 3 || !value[0].is_number() || !value[1].is_number() ||
        !value[2].is_number())
      throw InputError("{}: \"{}\" is not [x, y, z]; edit the tree again", field, key);
    return {value[0].get<double>(), value[1].get<double>(), value[2].get<double>()};
  }
};

Lesion lesion_of(const LesionFields& fields) {
  Lesion lesion;
  lesion.branch = fields.branch();
  if (!fields.member("vessel").is_string())
    throw InputError("{}: \"vessel\" is not text; edit the tree again", fields.field);
  lesion.vessel = fields.member("vessel").get<std::string>();
  lesion.at_mm = fields.number("at_mm");
  lesion.place_mm = fields.point("place_mm");
  lesion.length_mm = fields.above_zero("length_mm");
  lesion.reference_mm = fields.above_zero("reference_mm");
  lesion.least_mm = fields.above_zero("least_mm");
  if (fields.object.contains("sac")) {
    const LesionFields sac{fields.object["sac"], fields.field + ": \"sac\""};
    lesion.sac = {.centre_mm = sac.point("centre_mm"),
                  .diameter_mm = sac.above_zero("diameter_mm"),
                  .neck_mm = sac.above_zero("neck_mm"),
                  .branch = sac.branch()};
  }
  return lesion;
}

}  // namespace

std::string Lesion::in_words() const {
  if (sac)
    return fmt::format("{}: aneurysm of {:.1f} mm with a neck of {:.1f} mm at {:.1f} mm, vessel of {:.2f} mm",
                       vessel, sac->diameter_mm, sac->neck_mm, at_mm, reference_mm);
  return fmt::format(
      "{}: stenosis of {:.0f} % ({:.0f} % by area) at {:.1f} mm, {:.2f} to {:.2f} mm in diameter", vessel,
      percent(), area_percent(), at_mm, reference_mm, least_mm);
}

std::vector<Lesion> read_lesions(const std::filesystem::path& folder_or_file) {
  std::error_code error;
  std::filesystem::path file = folder_or_file;
  if (std::filesystem::is_directory(file, error)) {
    file /= kEditsFile;
    if (!std::filesystem::exists(file, error)) return {};
  }
  const nlohmann::json document = parse_json(read_whole_file(file), file.string());
  if (!document.is_object() || !document.contains("lesions") || !document["lesions"].is_array())
    throw InputError("{}: \"lesions\" is not a list; edit the tree again", file.string());
  std::vector<Lesion> lesions;
  for (const nlohmann::json& object : document["lesions"])
    lesions.push_back(lesion_of({object, fmt::format("{}: lesion {}", file.string(), lesions.size())}));
  return lesions;
}

std::string lesions_text(const std::vector<Lesion>& lesions) {
  Object list = Object::array();
  for (const Lesion& lesion : lesions) list.push_back(json_of_lesion(lesion));
  return list.dump();
}

}  // namespace xraycast
