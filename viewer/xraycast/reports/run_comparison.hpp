#pragma once

#include "xraycast/reports/saved_run.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// Throws InputError, with `name` in front, for a file that ends in neither .html, .csv nor .json.
void check_report_name(const std::filesystem::path& path, const std::string& name);

/// Runs side by side, in the order given, by the file's ending: a page with tables, plots over time and, of
/// several, a curve over the runs; a table with a line a run; or their JSON. The reference goes first. Throws
/// InputError as check_report_name, and Error where it cannot be written.
void write_runs(const std::filesystem::path& path, const std::vector<SavedRun>& runs,
                const std::optional<SavedRun>& reference = {}, const std::string& title = "Report of runs");

/// One run alone, by RunMonitor::json with its series, named as the file.
void write_report(const std::filesystem::path& path, const std::string& json);

}  // namespace xraycast
