#include "options/command.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/reports/run_comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace xraycast::cli {
namespace {

struct ReportArguments {
  std::vector<std::string> runs;
  std::string output, reference, title = "Report of runs";
  const CLI::App* command = nullptr;
};

constexpr const char* kReference = " (reference)";

/// Of --reference; none of an empty name.
std::optional<SavedRun> reference_of(const std::string& file) {
  if (file.empty()) return std::nullopt;
  std::vector<SavedRun> runs = read_runs(file).runs;
  if (runs.size() != 1) throw InputError("--reference {}: has {} runs; give one", file, runs.size());
  return std::move(runs[0]);
}

/// Runs of one name in files of several folders take that of their folder, as files that a page saves in one
/// of each pupil, and those that are still alike a number.
void tell_apart(std::vector<SavedRun>& runs, const std::vector<std::filesystem::path>& files) {
  std::vector<std::filesystem::path> folders;
  for (const std::filesystem::path& file : files)
    folders.push_back(std::filesystem::absolute(file).lexically_normal().parent_path());
  std::vector<std::string> names;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    bool is_elsewhere_too = false;
    for (std::size_t k = 0; k < runs.size(); ++k)
      is_elsewhere_too = is_elsewhere_too || (runs[k].name == runs[i].name && folders[k] != folders[i]);
    const std::string folder = printable_line(folders[i].filename().string());
    names.push_back(is_elsewhere_too && !folder.empty() ? folder + ": " + runs[i].name : runs[i].name);
  }
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const auto before = std::count(names.begin(), names.begin() + static_cast<std::ptrdiff_t>(i), names[i]);
    const std::string name = before > 0 ? fmt::format("{} ({})", names[i], before + 1) : names[i];
    if (name != runs[i].name) rename(runs[i], name);
  }
}

/// What is laid side by side: the runs of all files and, unless one is given, the reference that they have.
SavedRuns runs_of(const ReportArguments& options) {
  SavedRuns all{.runs = {}, .reference = reference_of(options.reference)};
  std::vector<std::filesystem::path> files;
  for (const std::string& file : options.runs) {
    SavedRuns some = read_runs(file);
    for (SavedRun& run : some.runs) all.runs.push_back(std::move(run));
    files.resize(all.runs.size(), file);
    if (!some.reference || !options.reference.empty()) continue;
    if (all.reference && all.reference->json != some.reference->json)
      throw InputError("{}: has another reference than the files before; give one by --reference", file);
    all.reference = std::move(some.reference);
  }
  tell_apart(all.runs, files);
  if (all.reference) all.reference->name += kReference;
  if (all.runs.empty()) throw InputError("{}: holds no run", options.runs.front());
  return all;
}

void report(const ReportArguments& options, Invocation& invocation) {
  check_report_name(options.output, options.output);
  check_writable(options.output);
  if (!has_extension(options.output, ".html"))
    check_not_given(*options.command, {"--title"}, "to a table or JSON; leave it out or write a .html");
  const auto [runs, reference] = runs_of(options);
  write_runs(options.output, runs, reference, options.title);
  const auto passed = std::ranges::count_if(runs, [](const SavedRun& run) { return run.is_passed; });
  const auto tasks = std::ranges::count_if(runs, [](const SavedRun& run) { return !run.exercise.empty(); });
  Json result{{"file", options.output}, {"runs", runs.size()}, {"exercises", tasks}, {"passed", passed}};
  invocation.report(result, fmt::format("{}: {}{}\n", options.output, pluralize(runs.size(), "run"),
                                        tasks > 0 ? fmt::format(", {} of {} passed", passed, tasks) : ""));
}

}  // namespace

void add_report(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<ReportArguments>();
  CLI::App* command =
      add_command(app, invocation, "report", "Lay reports of runs side by side, over the runs and over time",
                  "  xraycast report monday.json tuesday.json -o runs.html\n"
                  "  xraycast report runs/*.json --reference expert.json -o runs.csv\n"
                  "Reports are what `xraycast simulate --report` and a page's Save report write\n"
                  "(docs/exercises.md), in the order in which the runs were made.",
                  [options, &invocation] { report(*options, invocation); });
  options->command = command;
  command->add_option("RUN", options->runs, "Reports of runs (.json)")->required()->type_name("RUN");
  command
      ->add_option("-o,--output", options->output,
                   "A page with tables and plots (.html), a table with a line a run (.csv), or all as .json")
      ->required()
      ->type_name("HTML|CSV|JSON");
  command
      ->add_option(
          "--reference", options->reference,
          "The report of a run with which the others are compared (default: that of the files, if any)")
      ->type_name("RUN");
  command->add_option("--title", options->title, "The page's title")
      ->capture_default_str()
      ->type_name("TEXT");
}

}  // namespace xraycast::cli
