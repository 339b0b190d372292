#include "xraycast/simulation/exercise.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/geometry/branch_names.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <glm/common.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

namespace xraycast {
namespace {

using ExerciseJson = nlohmann::ordered_json;

constexpr std::size_t kLongestTitle = 80, kLongestTask = 2000, kMostTargets = 100, kMostNames = 32;
constexpr double kMostLimit = 1e6, kMostDepth_mm = 1000, kMostRadius_mm = 50;

/// An object's fields, of which every one must be known.
class ExerciseFields {
 public:
  ExerciseFields(const nlohmann::json& object, std::string where, const std::vector<std::string_view>& known)
      : object_(object), where_(std::move(where)) {
    if (!object.is_object()) throw InputError("{}: is not an object", where_);
    for (const auto& [key, value] : object.items())
      if (std::find(known.begin(), known.end(), key) == known.end())
        throw InputError("{}: has no field \"{}\"; the fields are {}", where_, excerpt(key),
                         fmt::join(known, ", "));
  }

  bool has(const char* key) const { return object_.contains(key); }
  std::string field(std::string_view key) const { return fmt::format("{}: \"{}\"", where_, key); }

  const nlohmann::json& value(const char* key) const {
    if (!has(key)) throw InputError("{}: \"{}\" is missing", where_, key);
    return object_[key];
  }

  std::string text(const char* key, std::size_t longest) const {
    if (!value(key).is_string()) throw InputError("{}: is not text", field(key));
    std::string text = value(key).get<std::string>();
    if (text.empty() || text.size() > longest)
      throw InputError("{}: has {} bytes; give 1 to {}", field(key), text.size(), longest);
    if (text != printable_line(text)) throw InputError("{}: has control characters; remove them", field(key));
    return text;
  }

  std::vector<std::string> names(const char* key) const {
    std::vector<std::string> names;
    const nlohmann::json& list = value(key);
    if (!list.is_array() || list.size() > kMostNames)
      throw InputError("{}: is not a list of at most {}", field(key), kMostNames);
    for (const nlohmann::json& name : list) {
      if (!name.is_string()) throw InputError("{}: {} is not a name", field(key), excerpt(name.dump()));
      names.push_back(name.get<std::string>());
    }
    return names;
  }

  double number(const char* key, double most) const {
    const nlohmann::json& json = value(key);
    if (!json.is_number()) throw InputError("{}: is not a number", field(key));
    const double number = json.get<double>();
    if (!(number > 0 && number <= most))
      throw InputError("{}: is {:g}; it must be above 0 and at most {:g}", field(key), number, most);
    return number;
  }

 private:
  const nlohmann::json& object_;
  std::string where_;
};

// ---- vessels

std::vector<int> vessel_of(const nlohmann::json& value, const std::string& field, const VesselTree& tree) {
  if (value.is_string()) return branches_named(tree, value.get<std::string>(), field);
  const auto count = static_cast<std::int64_t>(tree.branches().size());
  const auto number_of = [&](const nlohmann::json& number) {
    const std::optional<std::int64_t> branch = whole_number(number);
    if (!branch) throw InputError("{}: is neither a vessel's name nor the number of a branch", field);
    if (*branch < 0 || *branch >= count)
      throw InputError("{}: there is no branch {}; the tree has 0 to {}", field, *branch, count - 1);
    return static_cast<int>(*branch);
  };
  if (!value.is_array()) return {number_of(value)};
  std::vector<int> branches;  // as to_json() writes them
  for (const nlohmann::json& number : value) branches.push_back(number_of(number));
  if (branches.empty()) throw InputError("{}: has no branch", field);
  std::sort(branches.begin(), branches.end());
  return branches;
}

/// In words that can be read back, whatever the vessel is called.
std::string title_of(std::string_view lead, int branch, const VesselTree& tree) {
  const std::string name = vessel_name_of(tree.title(branch));
  return vessel_name_of(fmt::format("{}{}", lead, name.empty() ? fmt::format("branch {}", branch) : name));
}

glm::dvec3 place_of(const nlohmann::json& value, const std::string& field) {
  const auto is_number = [](const nlohmann::json& number) { return number.is_number(); };
  if (!value.is_array() || value.size() != 3 || !std::all_of(value.begin(), value.end(), is_number))
    throw InputError("{}: is not [x, y, z] in mm (LPS)", field);
  return {value[0].get<double>(), value[1].get<double>(), value[2].get<double>()};
}

void check_in_lumen(const ExerciseTarget& target, const std::string& field, const VesselTree& tree) {
  const VesselTree::Location near = tree.nearest(target.at_mm);
  const double outside_mm = near.distance_mm - near.radius_mm;
  if (std::isnan(outside_mm) || outside_mm > 0)
    throw InputError(
        "{}: lies {:.0f} mm outside the vessels, the nearest of which is {}; give a place in one", field,
        outside_mm, tree.title(near.branch));
}

// ---- parts

EntryChoice entry_in(const nlohmann::json& value, const std::string& field) {
  if (value.is_string()) return {value.get<std::string>(), field};
  if (value.is_array()) return {place_of(value, field), field};
  const std::optional<std::int64_t> branch = whole_number(value);
  if (!branch || *branch < -1'000'000 || *branch > 1'000'000)
    throw InputError("{}: is neither a branch's number, nor a vessel's name, nor [x, y, z]", field);
  return {static_cast<int>(*branch), field};
}

ExerciseTarget target_of(const nlohmann::json& value, const std::string& where, std::size_t instruments,
                         const VesselTree& tree) {
  const ExerciseFields fields(value, where,
                              {"name", "vessel", "depth_mm", "at_mm", "radius_mm", "instrument"});
  if (fields.has("vessel") == fields.has("at_mm"))
    throw InputError("{}: has {} of \"vessel\" and \"at_mm\"; give one", where,
                     fields.has("vessel") ? "both" : "neither");
  ExerciseTarget target;
  if (fields.has("vessel")) {
    if (fields.has("radius_mm")) throw InputError("{}: applies to \"at_mm\"", fields.field("radius_mm"));
    target.branches = vessel_of(fields.value("vessel"), fields.field("vessel"), tree);
    target.name = title_of("", target.branches.front(), tree);
    if (fields.has("depth_mm")) target.depth_mm = fields.number("depth_mm", kMostDepth_mm);
    if (const double deepest_mm = VesselDepth(tree, target.branches).deepest_mm();
        target.depth_mm > deepest_mm)
      throw InputError("{}: is {:g}, but {} ends {:.0f} mm beyond its origin; give less",
                       fields.field("depth_mm"), target.depth_mm, target.name, deepest_mm);
  } else {
    if (fields.has("depth_mm")) throw InputError("{}: applies to \"vessel\"", fields.field("depth_mm"));
    target.at_mm = place_of(fields.value("at_mm"), fields.field("at_mm"));
    if (fields.has("radius_mm")) target.radius_mm = fields.number("radius_mm", kMostRadius_mm);
    check_in_lumen(target, fields.field("at_mm"), tree);
    target.name = title_of("place in ", tree.nearest(target.at_mm).branch, tree);
  }
  if (fields.has("name")) target.name = fields.text("name", kLongestTitle);
  if (!fields.has("instrument")) return target;
  const std::optional<std::int64_t> number = whole_number(fields.value("instrument"));
  if (!number || *number < 1 || *number > static_cast<std::int64_t>(instruments))
    throw InputError("{}: must be 1{}", fields.field("instrument"),
                     instruments == 1 ? std::string(": there is one instrument")
                                      : fmt::format(", for the outermost instrument, to {}", instruments));
  target.instrument = static_cast<std::size_t>(*number - 1);
  return target;
}

ForbiddenVessel forbidden_in(const nlohmann::json& value, const std::string& field, const VesselTree& tree) {
  if (!value.is_object()) {
    std::vector<int> branches = vessel_of(value, field, tree);
    std::string name = title_of("", branches.front(), tree);
    return {std::move(name), std::move(branches)};
  }
  const ExerciseFields fields(value, field, {"name", "vessel"});
  return {fields.text("name", kLongestTitle),
          vessel_of(fields.value("vessel"), fields.field("vessel"), tree)};
}

ExerciseLimits limits_of(const nlohmann::json& value, const std::string& where) {
  std::vector<std::string_view> names;
  for (const ExerciseLimit& limit : kExerciseLimits) names.emplace_back(limit.name);
  const ExerciseFields fields(value, where, names);
  ExerciseLimits limits;
  for (const auto& [key, limit] : kExerciseLimits)
    if (fields.has(key)) limits.*limit = fields.number(key, kMostLimit);
  return limits;
}

/// Throws InputError for a target in a forbidden vessel, since nobody could pass.
void check_allowed_targets(const Exercise& exercise, const std::string& field) {
  const auto is_in = [](const ForbiddenVessel& vessel, int branch) {
    return std::find(vessel.branches.begin(), vessel.branches.end(), branch) != vessel.branches.end();
  };
  for (const ExerciseTarget& target : exercise.targets)
    for (const ForbiddenVessel& vessel : exercise.forbidden)
      for (const int branch : target.branches)
        if (is_in(vessel, branch))
          throw InputError("{}: {} is a target, so that nobody could pass; leave one of them out", field,
                           vessel.name);
}

}  // namespace

Exercise parse_exercise(const std::string& text, const std::string& origin, const VesselTree& tree) {
  const nlohmann::json document = parse_edited_json(text, origin);
  const ExerciseFields fields(
      document, origin,
      {"title", "task", "entry", "instruments", "devices", "targets", "forbidden", "limits", "reference"});
  Exercise exercise{.title = fields.text("title", kLongestTitle),
                    .task = fields.text("task", kLongestTask),
                    .instruments = fields.names("instruments"),
                    .devices = {},
                    .targets = {},
                    .forbidden = {},
                    .limits = {}};
  if (exercise.instruments.empty()) throw InputError("{}: names none", fields.field("instruments"));
  if (fields.has("entry")) exercise.entry = entry_in(fields.value("entry"), fields.field("entry"));
  if (fields.has("devices")) exercise.devices = fields.names("devices");
  const nlohmann::json& targets = fields.value("targets");
  if (!targets.is_array() || targets.empty() || targets.size() > kMostTargets)
    throw InputError("{}: is not a list of 1 to {}", fields.field("targets"), kMostTargets);
  for (const nlohmann::json& target : targets)
    exercise.targets.push_back(
        target_of(target, fmt::format("{}[{}]", fields.field("targets"), exercise.targets.size()),
                  exercise.instruments.size(), tree));
  if (fields.has("forbidden")) {
    const nlohmann::json& forbidden = fields.value("forbidden");
    if (!forbidden.is_array() || forbidden.size() > kMostTargets)
      throw InputError("{}: is not a list of at most {}", fields.field("forbidden"), kMostTargets);
    for (const nlohmann::json& vessel : forbidden)
      exercise.forbidden.push_back(forbidden_in(
          vessel, fmt::format("{}[{}]", fields.field("forbidden"), exercise.forbidden.size()), tree));
  }
  check_allowed_targets(exercise, fields.field("forbidden"));
  if (fields.has("limits")) exercise.limits = limits_of(fields.value("limits"), fields.field("limits"));
  if (fields.has("reference")) exercise.reference = fields.text("reference", kLongestTask);
  return exercise;
}

std::string to_json(const Exercise& exercise) {
  ExerciseJson json{{"title", exercise.title}, {"task", exercise.task}};
  json["instruments"] = exercise.instruments;
  json["devices"] = exercise.devices;
  for (const ExerciseTarget& target : exercise.targets) {
    ExerciseJson one{{"name", target.name}};
    if (target.branches.empty()) {
      one["at_mm"] = {target.at_mm.x, target.at_mm.y, target.at_mm.z};
      one["radius_mm"] = target.radius_mm;
    } else {
      one["vessel"] = target.branches;
      one["depth_mm"] = target.depth_mm;
    }
    if (target.instrument) one["instrument"] = *target.instrument + 1;
    json["targets"].push_back(std::move(one));
  }
  json["forbidden"] = ExerciseJson::array();
  for (const ForbiddenVessel& vessel : exercise.forbidden)
    json["forbidden"].push_back({{"name", vessel.name}, {"vessel", vessel.branches}});
  json["limits"] = ExerciseJson::object();
  for (const auto& [key, limit] : kExerciseLimits)
    if (exercise.limits.*limit) json["limits"][key] = *(exercise.limits.*limit);
  return json.dump(-1, ' ', false, ExerciseJson::error_handler_t::replace);  // names of files are any bytes
}

namespace {

/// A place on a branch, with the vessel's radius.
TargetMark mark_on(const VesselTree& tree, int number, double arc_length_mm) {
  const VesselBranch& branch = tree.branches()[static_cast<std::size_t>(number)];
  const std::vector<double>& arcs_mm = branch.arc_length_mm;
  const double arc_mm = std::clamp(arc_length_mm, 0.0, arcs_mm.back());
  const auto after = std::max<std::ptrdiff_t>(
      1, std::distance(arcs_mm.begin(), std::lower_bound(arcs_mm.begin(), arcs_mm.end(), arc_mm)));
  const auto k = static_cast<std::size_t>(after);
  const double share = (arc_mm - arcs_mm[k - 1]) / (arcs_mm[k] - arcs_mm[k - 1]);
  const VesselPoint &from = branch.points[k - 1], &to = branch.points[k];
  return {glm::mix(from.position_mm, to.position_mm, share), glm::mix(from.radius_mm, to.radius_mm, share),
          number, arc_mm};
}

}  // namespace

TargetMark mark_of(const ExerciseTarget& target, const VesselTree& tree) {
  if (target.branches.empty()) {
    const VesselTree::Location near = tree.nearest(target.at_mm);
    return {target.at_mm, target.radius_mm, near.branch, near.arc_length_mm};
  }
  const VesselDepth vessel(tree, target.branches);
  for (std::size_t b = 0; b < target.branches.size(); ++b) {
    const double arc_mm = target.depth_mm - vessel.start_mm(b);
    const VesselBranch& branch = tree.branches()[static_cast<std::size_t>(target.branches[b])];
    if (arc_mm >= 0 && arc_mm <= branch.arc_length_mm.back())
      return mark_on(tree, target.branches[b], arc_mm);
  }
  return mark_on(tree, target.branches.back(), target.depth_mm);  // by a rounding beyond its end
}

VesselDepth::VesselDepth(const VesselTree& tree, std::vector<int> branches) : branches_(std::move(branches)) {
  // A branch's parent may have any number: those before it in the vessel are walked up to.
  const auto is_of_vessel = [&](int branch) {
    return std::binary_search(branches_.begin(), branches_.end(), branch);
  };
  for (const int branch : branches_) {
    double start_mm = 0;
    int above = tree.branches()[static_cast<std::size_t>(branch)].parent;
    for (; above >= 0 && is_of_vessel(above); above = tree.branches()[static_cast<std::size_t>(above)].parent)
      start_mm += tree.branches()[static_cast<std::size_t>(above)].arc_length_mm.back();
    if (above >= 0) start_mm -= tree.branches()[static_cast<std::size_t>(above)].points.back().radius_mm;
    starts_mm_.push_back(start_mm);
    deepest_mm_ = std::max(deepest_mm_,
                           start_mm + tree.branches()[static_cast<std::size_t>(branch)].arc_length_mm.back());
    for (const int child : tree.branches()[static_cast<std::size_t>(branch)].children)
      if (!is_of_vessel(child))
        walls_mm_[child] = tree.branches()[static_cast<std::size_t>(branch)].points.back().radius_mm;
  }
}

std::optional<double> VesselDepth::beyond_mm(int branch, double arc_length_mm) const {
  const auto at = walls_mm_.find(branch);
  if (at == walls_mm_.end()) return std::nullopt;
  return arc_length_mm - at->second;
}

std::optional<double> VesselDepth::of_mm(int branch, double arc_length_mm) const {
  const auto at = std::lower_bound(branches_.begin(), branches_.end(), branch);
  if (at == branches_.end() || *at != branch) return std::nullopt;
  return starts_mm_[static_cast<std::size_t>(at - branches_.begin())] + arc_length_mm;
}

}  // namespace xraycast
