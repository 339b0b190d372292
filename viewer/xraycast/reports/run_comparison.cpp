#include "xraycast/reports/run_comparison.hpp"

#include "xraycast/base/base64.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/html_text.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/reports/html_page.hpp"
#include "xraycast/reports/plot.hpp"
#include "xraycast/reports/run_figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <string_view>

namespace xraycast {
namespace {

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
