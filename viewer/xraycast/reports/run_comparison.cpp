#include "xraycast/reports/run_comparison.hpp"

#include "xraycast/base/base64.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/html_text.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/reports/html_page.hpp"
#include "xraycast/reports/plot.hpp"

#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <string_view>
#include <utility>

namespace xraycast {
namespace {

using SavedJson = nlohmann::ordered_json;

/// A figure: its name in files, in words, its unit, and the decimals that are shown.
struct Figure {
  const char* name;
  const char* words;
  const char* unit;
  int decimals;
};

constexpr std::array<Figure, 8> kOfRun{{{"time_s", "time", "s", 1},
                                        {"idle_s", "idle", "s", 1},
                                        {"fluoroscopy_s", "fluoroscopy", "s", 1},
                                        {"exposures", "exposures", "", 0},
                                        {"air_kerma_mGy", "air kerma", "mGy", 2},
                                        {"dap_Gycm2", "dose-area product", "Gy cm²", 3},
                                        {"injected_ml", "contrast agent", "ml", 1},
                                        {"cine_runs", "cine runs", "", 0}}};
constexpr std::array<Figure, 14> kOfInstrument{
    {{"tip_path_mm", "path of the tip", "mm", 0},
     {"idle_s", "idle", "s", 1},
     {"turned_deg", "turned", "°", 0},
     {"turn_backs", "changes of the turn", "", 0},
     {"reversals", "reversals", "", 0},
     {"largest_force_N", "largest force at the hub", "N", 2},
     {"mean_force_N", "mean force at the hub", "N", 2},
     {"largest_torque_mNm", "largest torque at the hub", "mN m", 2},
     {"mean_torque_mNm", "mean torque at the hub", "mN m", 2},
     {"largest_wall_force_N", "largest force on the wall", "N", 2},
     {"wall_impulse_Ns", "impulse on the wall above 0.1 N", "N s", 2},
     {"slips", "slips", "", 0},
     {"whips", "whips", "", 0},
     {"exchanges", "exchanges", "", 0}}};
constexpr std::array<Figure, 27> kOfTreatment{
    {{"from_s", "begun", "s", 1},
     {"to_s", "ended", "s", 1},
     {"from_mm", "from, along the vessel", "mm", 1},
     {"to_mm", "to, along the vessel", "mm", 1},
     {"largest_bar", "largest pressure", "bar", 1},
     {"opened_mm", "opened to", "mm", 2},
     {"occluded_s", "vessel filled by the balloon", "s", 1},
     {"reference_mm", "reference diameter", "mm", 2},
     {"balloon_to_vessel", "balloon to vessel", "", 2},
     {"least_before_mm", "least diameter before", "mm", 2},
     {"least_after_mm", "least diameter after", "mm", 2},
     {"stenosis_before_percent", "stenosis before", "%", 0},
     {"residual_stenosis_percent", "residual stenosis", "%", 0},
     {"off_narrowest_mm", "off the narrowest place", "mm", 1},
     {"oversizing", "stent to vessel", "", 2},
     {"outward_N_mm", "stent's force outwards", "N/mm", 2},
     {"sheathed_rings", "rings still in the sheath", "", 0},
     {"stent_mm", "stent's diameter", "mm", 2},
     {"stent_length_mm", "stent's length", "mm", 1},
     {"malapposition_mm", "struts off the wall, largest", "mm", 2},
     {"malapposed_percent", "length of struts off the wall", "%", 0},
     {"coil_mm", "coil in the sac", "mm", 0},
     {"sac_mm3", "volume of the sac", "mm³", 0},
     {"packing_percent", "packing density", "%", 1},
     {"inflow_percent", "the sac's inflow, of that without coils", "%", 0},
     {"particles", "particles", "", 0},
     {"periphery_percent", "conductance left of the periphery", "%", 0}}};
constexpr std::array<Figure, 6> kCurves{{{"insertion_mm", "insertion", "mm", 0},
                                         {"tip_path_mm", "path of the tip", "mm", 0},
                                         {"force_N", "force at the hub", "N", 0},
                                         {"torque_mNm", "torque at the hub", "mN m", 0},
                                         {"wall_force_N", "force on the wall", "N", 0},
                                         {"pressure_mmHg", "mean pressure at the tip", "mmHg", 0}}};
constexpr const char* kMayBeMissing = "pressure_mmHg";  // in runs that were not told of it
constexpr std::size_t kMostInstruments = 3, kMostValues = 100'000, kMostRuns = 1000;
// Of an exercise; entries into at most so many forbidden vessels may be many.
constexpr std::size_t kMostTargets = 100, kMostTreatments = 100, kMostNotes = 10;

// ---- reading

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

// ---- writing

std::string value_of(const std::map<std::string, double>& figures, const Figure& figure) {
  const auto at = figures.find(figure.name);
  if (at == figures.end()) return "";
  const std::string unit = figure.unit;
  return fmt::format("{:.{}f}{}{}", at->second, figure.decimals, unit.empty() || unit == "°" ? "" : " ",
                     unit);
}

std::size_t most_instruments(const std::vector<SavedRun>& runs) {
  std::size_t most = 0;
  for (const SavedRun& run : runs) most = std::max(most, run.of_instruments.size());
  return most;
}

std::size_t most_treatments(const std::vector<SavedRun>& runs) {
  std::size_t most = 0;
  for (const SavedRun& run : runs) most = std::max(most, run.of_treatments.size());
  return most;
}

std::string cell(std::string_view tag, std::string_view text) {
  return fmt::format("<{0}>{1}</{0}>", tag, in_html(text));
}

template <typename Value>
std::string row(std::string_view words, const std::vector<SavedRun>& runs, const Value& value,
                bool begins_part = false) {
  std::string cells;
  bool is_empty = true;
  for (const SavedRun& run : runs) {
    const std::string text = value(run);
    is_empty = is_empty && text.empty();
    cells += cell("td", text);
  }
  return is_empty ? ""
                  : fmt::format("<tr{}><th scope=\"row\">{}</th>{}</tr>\n",
                                begins_part ? " class=\"part\"" : "", in_html(words), cells);
}

std::string outcome_of(const SavedRun& run) {
  if (run.exercise.empty()) return "";
  if (!run.is_complete) return "not complete";
  return (run.is_passed ? "passed" : "complete, but not passed") +
         (run.complete_s ? fmt::format(", after {:.1f} s", *run.complete_s) : std::string());
}

/// The outcomes of all runs by their names, in the order in which these first come.
std::vector<std::string> outcome_names(const std::vector<SavedRun>& runs) {
  std::vector<std::string> names;
  std::set<std::string> known;
  for (const SavedRun& run : runs)
    for (const SavedRun::Outcome& outcome : run.outcomes)
      if (known.insert(outcome.name).second) names.push_back(outcome.name);
  return names;
}

/// What became of each target, forbidden vessel and limit.
std::string outcomes_of(const std::vector<SavedRun>& runs) {
  std::string html;
  for (const std::string& name : outcome_names(runs))
    html += row(name, runs, [&](const SavedRun& run) {
      std::string all;
      for (const SavedRun::Outcome& outcome : run.outcomes)
        if (outcome.name == name) all += (all.empty() ? "" : ", ") + outcome.words;
      return all;
    });
  return html;
}

/// `first`: the runs that have a number, as in the curves over them, begin here.
std::string table_of(const std::vector<SavedRun>& runs, std::size_t first) {
  std::string html = "<div class=\"figures\"><table>\n<tr><th></th>";
  for (std::size_t i = 0; i < runs.size(); ++i)
    html += cell("th", i < first || runs.size() == first + 1
                           ? runs[i].name
                           : fmt::format("{}. {}", i - first + 1, runs[i].name));
  html += "</tr>\n";
  html += row("exercise", runs, [](const SavedRun& run) { return run.exercise; });
  html += row("result", runs, outcome_of);
  html += outcomes_of(runs);
  for (const Figure& figure : kOfRun)
    html += row(figure.words, runs, [&](const SavedRun& run) { return value_of(run.figures, figure); });
  for (std::size_t d = 0; d < most_instruments(runs); ++d) {
    const auto name_of = [&](const SavedRun& run) {
      return d < run.instruments.size() ? run.instruments[d] : std::string();
    };
    html += row(fmt::format("instrument {}", d + 1), runs, name_of, true);
    for (const Figure& figure : kOfInstrument)
      html += row(figure.words, runs, [&](const SavedRun& run) {
        return d < run.of_instruments.size() ? value_of(run.of_instruments[d], figure) : std::string();
      });
  }
  for (std::size_t t = 0; t < most_treatments(runs); ++t) {
    const auto name_of = [&](const SavedRun& run) {
      return t < run.treatments.size() ? run.treatments[t] : std::string();
    };
    html += row(fmt::format("treatment {}", t + 1), runs, name_of, true);
    for (const Figure& figure : kOfTreatment)
      html += row(figure.words, runs, [&](const SavedRun& run) {
        return t < run.of_treatments.size() ? value_of(run.of_treatments[t], figure) : std::string();
      });
  }
  html +=
      row("note", runs, [](const SavedRun& run) { return fmt::format("{}", fmt::join(run.notes, "; ")); });
  return html + "</table></div>\n";
}

std::string picture_of(const std::string& title, const std::string& x, const std::vector<Curve>& curves) {
  const RgbPicture picture = plot(title, x, "", curves);
  return fmt::format("<img alt=\"{}\" width=\"{}\" height=\"{}\" src=\"data:image/png;base64,{}\">\n",
                     in_html(title), picture.width, picture.height,
                     to_base64(png_bytes(picture.rgb, picture.width, picture.height, 3)));
}

/// A plot of each kind of values, with a curve an instrument of each of the first runs.
std::string plots_over_time(const std::vector<SavedRun>& runs) {
  constexpr std::size_t kMostCurves = 8;
  std::string html;
  for (const Figure& figure : kCurves) {
    std::vector<Curve> curves;
    for (const SavedRun& run : runs)
      for (std::size_t d = 0; d < run.curves.size() && curves.size() < kMostCurves; ++d) {
        if (!run.curves[d].contains(figure.name)) continue;
        const std::string instrument =
            d < run.instruments.size() ? run.instruments[d] : fmt::format("instrument {}", d + 1);
        Curve curve{runs.size() == 1 ? instrument : run.name + ", " + instrument, {}, {}, curves.size()};
        const std::vector<double>& values = run.curves[d].at(figure.name);
        for (std::size_t i = 0; i < values.size(); ++i) curve.points.emplace_back(run.time_s[i], values[i]);
        if (curve.points.size() > 1) curves.push_back(std::move(curve));
      }
    if (!curves.empty())
      html += picture_of(fmt::format("{} ({})", figure.words, figure.unit), "time (s)", curves);
  }
  return html;
}

/// What one learns by: figures of the runs, one after the other, against the reference's.
std::string learning_curves(const std::vector<SavedRun>& runs, const std::optional<SavedRun>& reference) {
  if (runs.size() < 2) return "";
  std::string html;
  const auto add = [&](const Figure& figure, const auto& value_in) {
    Curve curve{"runs", {}};
    for (std::size_t i = 0; i < runs.size(); ++i)
      if (const std::optional<double> value = value_in(runs[i]))
        curve.points.emplace_back(static_cast<double>(i + 1), *value);
    if (curve.points.size() < 2) return;
    std::vector<Curve> curves{std::move(curve)};
    if (const std::optional<double> value = reference ? value_in(*reference) : std::nullopt)
      curves.push_back({"reference", {{1, *value}, {static_cast<double>(runs.size()), *value}}, {}, 1});
    const std::string unit = *figure.unit ? fmt::format(" ({})", figure.unit) : "";
    html += picture_of(fmt::format("{} over the runs{}", figure.words, unit), "run", curves);
  };
  const auto in = [](const std::map<std::string, double>& figures, const char* name) {
    const auto at = figures.find(name);
    return at == figures.end() ? std::nullopt : std::optional(at->second);
  };
  add({"", "time to the last target", "s", 1}, [](const SavedRun& run) { return run.complete_s; });
  for (const Figure& figure : kOfRun)
    if (figure.name == std::string_view("time_s") || figure.name == std::string_view("fluoroscopy_s"))
      add(figure, [&](const SavedRun& run) { return in(run.figures, figure.name); });
  for (const Figure& figure : kOfInstrument) {
    const bool is_path = figure.name == std::string_view("tip_path_mm");
    if (!is_path && figure.name != std::string_view("largest_wall_force_N")) continue;
    add(figure, [&](const SavedRun& run) -> std::optional<double> {
      double of_all = 0;
      for (const auto& figures : run.of_instruments) {
        const std::optional<double> value = in(figures, figure.name);
        if (!value) return std::nullopt;
        of_all = is_path ? of_all + *value : std::max(of_all, *value);
      }
      return of_all;
    });
  }
  return html;
}

constexpr const char* kRunsHead =
    R"(<meta name="color-scheme" content="light dark">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'; img-src data:">
)";
constexpr const char* kRunsStyle =
    R"(body { font: 16px/1.5 sans-serif; margin: 2em auto; max-width: 1500px; padding: 0 1em; }
main { align-items: flex-start; display: flex; flex-wrap: wrap; gap: 1em 2em; }
.figures { max-width: 100%; overflow-x: auto; }
.plots { display: grid; flex: 1 1 340px; gap: 1em; grid-template-columns: repeat(auto-fit, minmax(min(340px, 100%), 1fr)); }
table { border-collapse: collapse; }
th, td { border-bottom: 1px solid #8884; padding: .2em 1.2em .2em 0; text-align: left; vertical-align: top; }
th[scope="row"] { font-weight: normal; }
.part th, .part td { font-weight: bold; padding-top: 1.2em; }
td { font-variant-numeric: tabular-nums; }
img { height: auto; max-width: 100%; }
)";

std::string page_of(const std::vector<SavedRun>& runs, const std::optional<SavedRun>& reference,
                    const std::string& title) {
  std::vector<SavedRun> all = runs;
  if (reference) all.insert(all.begin(), *reference);
  return html_page(title, kRunsHead, kRunsStyle,
                   "<main>\n" + table_of(all, reference ? 1 : 0) + "<div class=\"plots\">\n" +
                       learning_curves(runs, reference) + plots_over_time(all) +
                       "</div>\n</main>\n<footer><p>Not for clinical use.</p></footer>\n");
}

std::string quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + '"';
}

std::string csv_of(const std::vector<SavedRun>& runs) {
  const std::size_t instruments = most_instruments(runs);
  std::string csv = "run,exercise,is_complete,is_passed";
  for (const Figure& figure : kOfRun) csv += fmt::format(",{}", figure.name);
  for (std::size_t d = 0; d < instruments; ++d) {
    csv += fmt::format(",instrument_{}", d + 1);
    for (const Figure& figure : kOfInstrument) csv += fmt::format(",{}_{}", figure.name, d + 1);
  }
  const std::size_t treatments = most_treatments(runs);
  for (std::size_t t = 1; t <= treatments; ++t) {
    csv += fmt::format(",treatment_{}", t);
    for (const Figure& figure : kOfTreatment) csv += fmt::format(",treatment_{}_{}", t, figure.name);
  }
  const std::vector<std::string> outcomes = outcome_names(runs);
  for (const std::string& name : outcomes) csv += "," + quoted(name + " (s)");
  csv += '\n';
  const auto add = [&](const std::map<std::string, double>& figures, const Figure& figure) {
    const auto at = figures.find(figure.name);
    csv += at == figures.end() ? "," : fmt::format(",{}", at->second);
  };
  for (const SavedRun& run : runs) {
    csv += fmt::format("{},{},", quoted(run.name), quoted(run.exercise));
    csv += run.exercise.empty() ? "," : fmt::format("{:d},{:d}", run.is_complete, run.is_passed);
    for (const Figure& figure : kOfRun) add(run.figures, figure);
    for (std::size_t d = 0; d < instruments; ++d) {
      const bool has = d < run.of_instruments.size();
      csv += fmt::format(",{}", has ? quoted(run.instruments[d]) : "");
      for (const Figure& figure : kOfInstrument)
        add(has ? run.of_instruments[d] : std::map<std::string, double>{}, figure);
    }
    for (std::size_t t = 0; t < treatments; ++t) {
      const bool has = t < run.of_treatments.size();
      csv += fmt::format(",{}", has ? quoted(run.treatments[t]) : "");
      for (const Figure& figure : kOfTreatment)
        add(has ? run.of_treatments[t] : std::map<std::string, double>{}, figure);
    }
    for (const std::string& name : outcomes) {
      const auto at = std::ranges::find(run.outcomes, name, &SavedRun::Outcome::name);
      csv += at == run.outcomes.end() || !at->time_s ? "," : fmt::format(",{}", *at->time_s);
    }
    csv += '\n';
  }
  return csv;
}

std::string json_of(const std::vector<SavedRun>& runs, const std::optional<SavedRun>& reference) {
  if (runs.size() == 1 && !reference) return runs.front().json + "\n";
  std::string json = "{\"version\":1,";
  if (reference) json += fmt::format("\"reference\":{},\n", reference->json);
  json += "\"runs\":[\n";
  for (std::size_t i = 0; i < runs.size(); ++i) json += (i > 0 ? ",\n" : "") + runs[i].json;
  return json + "]}\n";
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

void check_report_name(const std::filesystem::path& path, const std::string& name) {
  for (const char* extension : {".html", ".csv", ".json"})
    if (has_extension(path, extension)) return;
  throw InputError("{}: must end in .html, for a page, .csv, for a table, or .json", name);
}

void write_runs(const std::filesystem::path& path, const std::vector<SavedRun>& runs,
                const std::optional<SavedRun>& reference, const std::string& title) {
  check_report_name(path, path.string());
  if (has_extension(path, ".html")) return write_whole_file(path, page_of(runs, reference, title));
  if (has_extension(path, ".json")) return write_whole_file(path, json_of(runs, reference));
  std::vector<SavedRun> all = runs;
  if (reference) all.insert(all.begin(), *reference);
  write_whole_file(path, csv_of(all));
}

void write_report(const std::filesystem::path& path, const std::string& json) {
  write_runs(path, {SavedRun::parse(json, printable_line(path.stem().string()))});
}

}  // namespace xraycast
