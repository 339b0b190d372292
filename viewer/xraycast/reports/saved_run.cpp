#include "xraycast/reports/saved_run.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/reports/run_figures.hpp"

#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <string_view>
#include <utility>

namespace xraycast {
namespace {

using SavedJson = nlohmann::ordered_json;

constexpr const char* kMayBeMissing = "pressure_mmHg";  // in runs that were not told of it
constexpr std::size_t kMostInstruments = 3, kMostValues = 100'000, kMostRuns = 1000;
// Of an exercise; entries into at most so many forbidden vessels may be many.
constexpr std::size_t kMostTargets = 100, kMostTreatments = 100, kMostNotes = 10;

const SavedJson* find(const SavedJson& object, const char* key) {
  const auto at = object.find(key);
  return at == object.end() || at->is_null() ? nullptr : &*at;
}

double number_in(const SavedJson& value, const std::string& where) {
  constexpr double kMost = 1e9;  // beyond any run; what axes can be drawn of
  if (!value.is_number() || !(std::abs(value.get<double>()) <= kMost))
    throw InputError("{}: is not a number from -1e9 to 1e9", where);
  return value.get<double>();
}

std::string text_in(const SavedJson& object, const char* key, const std::string& where) {
  const SavedJson* value = find(object, key);
  if (!value) return {};
  if (!value->is_string()) throw InputError("{}: \"{}\" is not text", where, key);
  return printable_line(value->get<std::string>());
}

const SavedJson& list_in(const SavedJson& object, const char* key, std::size_t most,
                         const std::string& where) {
  static const SavedJson none = SavedJson::array();
  const SavedJson* value = find(object, key);
  if (!value) return none;
  if (!value->is_array() || value->size() > most)
    throw InputError("{}: \"{}\" is not a list of at most {}", where, key, most);
  for (const SavedJson& element : *value)
    if (!element.is_object() && !element.is_number())
      throw InputError("{}: \"{}\" has {}", where, key, excerpt(element.dump()));
  return *value;
}

template <std::size_t N>
std::map<std::string, double> figures_in(const SavedJson& object, const std::array<Figure, N>& known,
                                         const std::string& where) {
  if (!object.is_object()) throw InputError("{}: is not an object", where);
  std::map<std::string, double> figures;
  for (const Figure& figure : known)
    if (const SavedJson* value = find(object, figure.name))
      figures[figure.name] = number_in(*value, fmt::format("{}: \"{}\"", where, figure.name));
  return figures;
}

std::vector<double> values_in(const SavedJson& list, const std::string& where) {
  std::vector<double> values;
  for (const SavedJson& value : list) values.push_back(number_in(value, where));
  return values;
}

/// A limit of an exercise: its field, in words, and its unit.
struct LimitWords {
  const char* field;
  const char* words;
  const char* unit;
};
constexpr std::array<LimitWords, 7> kLimits{{{"time_s", "time", "s"},
                                             {"fluoroscopy_s", "fluoroscopy", "s"},
                                             {"air_kerma_mGy", "air kerma", "mGy"},
                                             {"dap_Gycm2", "dose-area product", "Gy cm²"},
                                             {"contrast_ml", "contrast agent", "ml"},
                                             {"force_N", "force at the hub", "N"},
                                             {"wall_force_N", "force on the wall", "N"}}};

/// A limit with what was used of it.
SavedRun::Outcome limit_outcome(const SavedJson& limit, const std::string& where) {
  const std::string field = text_in(limit, "name", where);
  const auto known = std::ranges::find(kLimits, std::string_view(field), &LimitWords::field);
  const auto number = [&](const char* key) {
    const SavedJson* value = find(limit, key);
    return value ? std::optional(number_in(*value, where)) : std::nullopt;
  };
  const std::string unit = known == kLimits.end() ? "" : fmt::format(" {}", known->unit);
  SavedRun::Outcome outcome{known == kLimits.end() ? field : known->words, "", number("passed_s")};
  if (const std::optional<double> most = number("limit"))
    outcome.name += fmt::format(" of {:g}{}", *most, unit);
  outcome.name = "limit: " + outcome.name;
  const std::optional<double> largest = number("largest");
  if (largest) outcome.words = fmt::format("{:.3g}{}", *largest, unit);
  if (outcome.time_s)
    outcome.words += fmt::format("{}passed after {:.1f} s", largest ? ", " : "", *outcome.time_s);
  else if (!largest)
    outcome.words = "not counted";
  return outcome;
}

void read_exercise(const SavedJson& exercise, const std::string& where, SavedRun& run) {
  if (!exercise.is_object()) throw InputError("{}: is not an object", where);
  const auto is_set = [&](const char* key) {
    const SavedJson* value = find(exercise, key);
    return value && value->is_boolean() && value->get<bool>();
  };
  run.exercise = text_in(exercise, "title", where);
  run.is_complete = is_set("is_complete");
  run.is_passed = is_set("is_passed");
  const auto add = [&](const char* list, std::size_t most, const auto& outcome_of) {
    std::set<std::string> names;
    for (const SavedJson& one : list_in(exercise, list, most, where)) {
      if (!one.is_object()) throw InputError("{}: \"{}\" has {}", where, list, excerpt(one.dump()));
      SavedRun::Outcome outcome = outcome_of(one);
      if (names.insert(outcome.name).second && names.size() > kMostTargets)
        throw InputError("{}: \"{}\" has more than {} names", where, list, kMostTargets);
      run.outcomes.push_back(std::move(outcome));
    }
  };
  const auto at_time = [&](const SavedJson& one, const char* kind, const char* time) {
    SavedRun::Outcome outcome{kind + text_in(one, "name", where), "not reached", {}};
    if (const SavedJson* value = find(one, time)) {
      outcome.time_s = number_in(*value, where);
      outcome.words = fmt::format("{:.1f} s", *outcome.time_s);
    }
    return outcome;
  };
  add("targets", kMostTargets, [&](const SavedJson& one) { return at_time(one, "target: ", "reached_s"); });
  if (run.is_complete)
    for (const SavedRun::Outcome& target : run.outcomes)
      run.complete_s = std::max(run.complete_s, target.time_s);
  add("forbidden_entries", kMostValues,
      [&](const SavedJson& one) { return at_time(one, "forbidden: ", "time_s"); });
  add("limits", kMostTargets, [&](const SavedJson& one) { return limit_outcome(one, where); });
}

void read_series(const SavedJson& series, const std::string& where, SavedRun& run) {
  if (!series.is_object()) throw InputError("{}: is not an object", where);
  run.time_s = values_in(list_in(series, "time_s", kMostValues, where), where);
  for (const SavedJson& instrument : list_in(series, "instruments", kMostInstruments, where)) {
    SavedRun::Curves& curves = run.curves.emplace_back();
    if (!instrument.is_object()) throw InputError("{}: is not an object", where);
    for (const Figure& figure : kCurves) {
      if (!find(instrument, figure.name) && figure.name == std::string_view(kMayBeMissing)) continue;
      std::vector<double> values = values_in(list_in(instrument, figure.name, kMostValues, where), where);
      if (values.size() != run.time_s.size())
        throw InputError("{}: \"{}\" has {} values, but there are {} times", where, figure.name,
                         values.size(), run.time_s.size());
      curves[figure.name] = std::move(values);
    }
  }
}

bool has_version(const SavedJson& json) {
  const SavedJson* version = json.is_object() ? find(json, "version") : nullptr;
  return version && *version == 1;
}

std::vector<std::string> notes_in(const SavedJson& json, const std::string& origin) {
  const SavedJson* notes = find(json, "notes");
  if (!notes) return {};
  const auto is_text = [](const SavedJson& note) { return note.is_string(); };
  if (!notes->is_array() || notes->size() > kMostNotes || !std::ranges::all_of(*notes, is_text))
    throw InputError("{}: \"notes\" is not a list of at most {} texts", origin, kMostNotes);
  std::vector<std::string> lines;
  for (const SavedJson& note : *notes) lines.push_back(printable_line(note.get<std::string>()));
  return lines;
}

void set_name(SavedRun& run, const std::string& name, SavedJson json) {
  run.name = name;
  json["name"] = name;
  run.json = json.dump(-1, ' ', false, SavedJson::error_handler_t::replace);
}

SavedRun saved_run(SavedJson json, const std::string& name, const std::string& origin) {
  if (!has_version(json) || !find(json, "instruments"))
    throw InputError("{}: is no report of a run; save one by --report of `xraycast simulate`, or in a page",
                     origin);
  SavedRun run{.name = text_in(json, "name", origin),
               .instruments = {},
               .figures = figures_in(json, kOfRun, origin),
               .of_instruments = {}};
  if (run.name.empty()) run.name = name;
  for (const SavedJson& instrument : list_in(json, "instruments", kMostInstruments, origin)) {
    run.of_instruments.push_back(figures_in(instrument, kOfInstrument, origin + ": \"instruments\""));
    run.instruments.push_back(text_in(instrument, "name", origin));
  }
  for (const SavedJson& treatment : list_in(json, "treatments", kMostTreatments, origin)) {
    const std::string where = origin + ": \"treatments\"";
    run.of_treatments.push_back(figures_in(treatment, kOfTreatment, where));
    run.treatments.push_back(text_in(treatment, "device", where) + " in " +
                             text_in(treatment, "vessel", where));
  }
  if (const SavedJson* exercise = find(json, "exercise"))
    read_exercise(*exercise, origin + ": \"exercise\"", run);
  run.notes = notes_in(json, origin);
  if (const SavedJson* series = find(json, "series")) read_series(*series, origin + ": \"series\"", run);
  set_name(run, run.name, std::move(json));
  return run;
}

SavedJson parsed(const std::string& text, const std::string& origin) {
  parse_json(text, origin);  // its depth
  return SavedJson::parse(text, nullptr, false);
}

}  // namespace

SavedRun SavedRun::parse(const std::string& text, const std::string& name, const std::string& origin) {
  return saved_run(parsed(text, origin), name, origin);
}

SavedRuns read_runs(const std::filesystem::path& path) {
  const std::string origin = path.string(), name = printable_line(path.stem().string());
  SavedJson json = parsed(read_whole_file(path), origin);
  if (json.is_object()) json.erase("name");  // a file may have been renamed since
  if (!json.is_object() || !find(json, "runs")) return {{saved_run(std::move(json), name, origin)}};
  if (!has_version(json)) throw InputError("{}: \"version\" is not 1, the only one that there is", origin);
  SavedRuns all;
  for (const SavedJson& run : list_in(json, "runs", kMostRuns, origin))
    all.runs.push_back(saved_run(run, fmt::format("{} {}", name, all.runs.size() + 1), origin));
  if (const SavedJson* reference = find(json, "reference"))
    all.reference = saved_run(*reference, "reference", origin + ": \"reference\"");
  return all;
}

void rename(SavedRun& run, const std::string& name) {
  set_name(run, name, SavedJson::parse(run.json, nullptr, false));
}

}  // namespace xraycast
