#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/motion/motion.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <initializer_list>
#include <map>
#include <utility>

namespace xraycast {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr std::int64_t kVersion = 1;

/// A value of the file and its place in it, for messages.
struct Entry {
  const Json& json;
  std::string name;

  bool has(const char* field) const { return json.contains(field); }
  Entry at(const char* field) const {
    if (!has(field)) throw InputError("{}: {} is missing; add it", name, field);
    return {json.at(field), name + ": " + field};
  }
  Entry at(std::size_t index) const { return {json.at(index), fmt::format("{}[{}]", name, index)}; }

  double number() const {
    if (!json.is_number()) throw InputError("{} must be a number", name);
    return json.get<double>();
  }
  std::string text() const {
    if (!json.is_string()) throw InputError("{} must be a text", name);
    return json.get<std::string>();
  }
  /// The number of a list's entries.
  std::size_t length() const {
    if (!json.is_array()) throw InputError("{} must be a list", name);
    return json.size();
  }
  /// Throws InputError for what is no object, and for a field that none knows: it would be without effect.
  void require_fields(std::initializer_list<const char*> known) const {
    if (!json.is_object()) throw InputError("{} must be an object", name);
    for (const auto& [field, value] : json.items())
      if (std::ranges::find(known, field) == known.end())
        throw InputError("{}: {} is unknown; it takes {}", name, excerpt(field), fmt::join(known, ", "));
  }
};

/// The fields of a motion, each read once.
class Fields {
 public:
  explicit Fields(fs::path folder) : folder_(std::move(folder)) {}

  std::shared_ptr<const Displacement> of(const Entry& entry) {
    const std::string key = entry.json.dump(-1, ' ', false, Json::error_handler_t::replace);
    if (const auto known = fields_.find(key); known != fields_.end()) return known->second;
    return fields_[key] = entry.json.is_array() ? composition(entry) : file(entry);
  }

  /// Of the files that were read.
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  std::shared_ptr<const Displacement> file(const Entry& entry) {
    const std::string name = entry.text();
    std::error_code error;
    if (!fs::is_regular_file(folder_ / name, error))
      throw InputError("{}: {} is no file; put it beside the motion", entry.name, excerpt(name));
    return read_displacement(folder_ / name, &warnings_);
  }

  std::shared_ptr<const Displacement> composition(const Entry& entry) {
    std::vector<std::shared_ptr<const Displacement>> parts;
    for (std::size_t i = 0; i < entry.length(); ++i)
      if (entry.at(i).json.is_array())
        throw InputError("{} is a list in a list; name its files", entry.at(i).name);
      else
        parts.push_back(of(entry.at(i)));
    if (parts.empty()) throw InputError("{} is an empty list; name its files", entry.name);
    return composed(std::move(parts));
  }

  fs::path folder_;
  std::vector<std::string> warnings_;
  std::map<std::string, std::shared_ptr<const Displacement>> fields_;
};

std::vector<PhaseSample> waveform_of(const Entry& entry) {
  std::vector<PhaseSample> samples;
  for (std::size_t i = 0; i < entry.length(); ++i) {
    const Entry sample = entry.at(i);
    if (sample.length() != 2) throw InputError("{} must be a time in s and a phase", sample.name);
    samples.push_back({sample.at(std::size_t{0}).number(), sample.at(1).number()});
  }
  if (samples.empty()) throw InputError("{} is empty; give samples of time and phase", entry.name);
  return samples;
}

MotionMode mode_of(const Entry& entry, Fields& fields) {
  entry.require_fields({"name", "period_s", "waveform", "phases", "comment"});
  MotionMode mode;
  mode.name = entry.at("name").text();
  if (entry.has("waveform") && entry.has("period_s"))
    throw InputError("{}: has both period_s and waveform; leave one of them out", entry.name);
  if (entry.has("waveform")) mode.waveform = waveform_of(entry.at("waveform"));
  if (entry.has("period_s") || mode.waveform.empty()) mode.period_s = entry.at("period_s").number();
  const Entry phases = entry.at("phases");
  for (std::size_t i = 0; i < phases.length(); ++i) {
    const Entry phase = phases.at(i);
    phase.require_fields({"phase", "field"});
    KeyPhase& key = mode.keys.emplace_back();
    key.phase = phase.at("phase").number();
    if (phase.has("field")) key.moves = fields.of(phase.at("field"));
  }
  return mode;
}

}  // namespace

Motion read_motion(const fs::path& path) {
  const std::string name = path.string();
  const Json document = parse_json(read_whole_file(path), name);
  const Entry root{document, name};
  if (!document.is_object()) throw InputError("{}: holds no JSON object; give a motion.json", name);
  root.require_fields({"version", "modes", "comment"});
  if (whole_number(root.at("version").json) != kVersion)
    throw InputError("{}: version is not {}; write the motion again or use a newer xraycast", name, kVersion);
  Fields fields(path.parent_path());
  std::vector<MotionMode> modes;
  const Entry list = root.at("modes");
  for (std::size_t m = 0; m < list.length(); ++m) modes.push_back(mode_of(list.at(m), fields));
  return {std::move(modes), name, fields.warnings()};
}

}  // namespace xraycast
