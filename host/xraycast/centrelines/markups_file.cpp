// 3D Slicer's markups: markups-schema-v1.0.3.json in Modules/Loadable/Markups/Resources/Schema of its
// sources.
#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/centrelines/stored_centrelines.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <limits>
#include <string>
#include <string_view>

namespace xraycast {
namespace {

/// Of an object; empty where it is no text.
std::string text_member(const nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

/// The list that an object holds there; an empty one without it.
const nlohmann::json& list_member(const nlohmann::json& object, const char* key, const std::string& field) {
  static const nlohmann::json empty = nlohmann::json::array();
  const auto found = object.find(key);
  if (found == object.end() || found->is_null()) return empty;
  if (!found->is_array()) throw InputError("{}: \"{}\" is not a list", field, key);
  return *found;
}

/// Of both a word and a code of three words, of which it is the first.
double unit_mm(const nlohmann::json& markup, const std::string& field) {
  const auto found = markup.find("coordinateUnits");
  if (found == markup.end()) return 1;
  const nlohmann::json& unit = found->is_array() && !found->empty() ? found->front() : *found;
  if (unit == "mm") return 1;
  if (unit == "um") return 1e-3;
  throw InputError("{}: \"coordinateUnits\" {} is neither mm nor um", field, excerpt(unit.dump()));
}

/// The curve's name in the label of its first control point, which 3D Slicer makes of name and number: "left
/// renal artery-1". Empty where it is the one that a new curve gets, such as "OC" or "Centerline curve (3)".
std::string curve_name(std::string_view label) {
  label = label.substr(0, label.find_last_of('-'));
  std::string plain = lower_case(label);
  while (!plain.empty() && std::string_view("0123456789()_- ").find(plain.back()) != std::string_view::npos)
    plain.pop_back();
  constexpr std::array<std::string_view, 9> kOfNewCurves = {
      "c", "oc", "cc", "l", "line", "curve", "open curve", "centerline curve", "network curve"};
  return std::ranges::find(kOfNewCurves, plain) != kOfNewCurves.end() ? "" : std::string(label);
}

class MarkupReader {
 public:
  MarkupReader(const nlohmann::json& markup, std::string field)
      : markup_(markup), field_(std::move(field)), unit_mm_(unit_mm(markup, field_)) {
    const std::string frame = text_member(markup, "coordinateSystem");
    if (frame == "RAS")
      sign_ = -1;
    else if (!frame.empty() && frame != "LPS")
      throw InputError("{}: \"coordinateSystem\" \"{}\" is neither LPS nor RAS", field_, excerpt(frame));
  }

  CentrelineLine read() {
    const nlohmann::json& points = list_member(markup_, "controlPoints", field_);
    line_.name = text_member(markup_, "name");
    if (line_.name.empty() && !points.empty() && points.front().is_object())
      line_.name = curve_name(text_member(points.front(), "label"));
    const nlohmann::json* const radii = radii_of(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) read_point(points[i], radii ? &(*radii)[i] : nullptr);
    if (text_member(markup_, "type") == "ClosedCurve" && !line_.points_mm.empty()) {
      line_.points_mm.push_back(line_.points_mm.front());
      if (!line_.radii_mm.empty()) line_.radii_mm.push_back(line_.radii_mm.front());
    }
    return std::move(line_);
  }

 private:
  /// The measurement of that name, with a number for each control point.
  const nlohmann::json* radii_of(std::size_t points) const {
    for (const nlohmann::json& measurement : list_member(markup_, "measurements", field_)) {
      if (!measurement.is_object() || lower_case(text_member(measurement, "name")) != "radius") continue;
      const nlohmann::json& values = list_member(measurement, "controlPointValues", field_);
      if (values.empty()) continue;
      if (values.size() != points)
        throw InputError("{}: the measurement \"radius\" has {} values for {} control points", field_,
                         values.size(), points);
      return &values;
    }
    return nullptr;
  }

  /// Points without a position, or whose position is only a preview, are none.
  void read_point(const nlohmann::json& point, const nlohmann::json* radius) {
    if (!point.is_object()) throw InputError("{}: a control point is not an object", field_);
    const std::string status = text_member(point, "positionStatus");
    if (!status.empty() && status != "defined") return;
    const nlohmann::json& position = list_member(point, "position", field_);
    if (position.empty()) return;
    if (position.size() != 3 || !position[0].is_number() || !position[1].is_number() ||
        !position[2].is_number())
      throw InputError("{}: a position is [x, y, z], not {}", field_, excerpt(position.dump()));
    const glm::dvec3 stored(position[0].get<double>(), position[1].get<double>(), position[2].get<double>());
    line_.points_mm.push_back(unit_mm_ * glm::dvec3(sign_ * stored.x, sign_ * stored.y, stored.z));
    if (radius)
      line_.radii_mm.push_back(radius->is_number() ? unit_mm_ * radius->get<double>()
                                                   : std::numeric_limits<double>::quiet_NaN());
  }

  const nlohmann::json& markup_;
  std::string field_;
  double unit_mm_, sign_ = 1;
  CentrelineLine line_;
};

}  // namespace

StoredCentrelines read_markups(const std::filesystem::path& path) {
  const std::string name = path.string();
  const nlohmann::json document = parse_json(read_whole_file(path), name);
  if (!document.is_object() || !document.contains("markups"))
    throw InputError("{}: \"markups\" is missing; save the curves in 3D Slicer as .mrk.json", name);
  StoredCentrelines stored{{}, true};
  const nlohmann::json& markups = list_member(document, "markups", name);
  for (std::size_t i = 0; i < markups.size(); ++i) {
    if (!markups[i].is_object()) throw InputError("{}: markup {} is not an object", name, i);
    const std::string type = text_member(markups[i], "type");
    if (type == "Curve" || type == "ClosedCurve" || type == "Line")
      stored.lines.push_back(MarkupReader(markups[i], fmt::format("{}: markup {}", name, i)).read());
  }
  if (stored.lines.empty())
    throw InputError("{}: the file has no curves; save curves in 3D Slicer, not a list of points", name);
  return stored;
}

}  // namespace xraycast
