#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/casting/map_geometry.hpp"
#include "xraycast/scan/scan.hpp"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace xraycast::cli {

using Json = nlohmann::ordered_json;

/// What all subcommands share: the global options, the progress of the job, and the job itself, which the
/// chosen subcommand leaves here while the arguments are parsed.
struct Session {
  std::string device;
  bool json = false;
  bool quiet = false;
  Progress progress;
  std::function<void()> job;

  explicit Session(Progress::Listener listener) : progress(std::move(listener)) {}

  /// One line on stderr each, unless --quiet.
  void say(const std::vector<std::string>& lines) const;

  /// What was asked for, on stdout: the JSON with --json, else the text.
  void answer(const Json& result, const std::string& text) const;

  /// The same about files that were written; --quiet silences the text.
  void report(const Json& result, const std::string& text) const;
};

/// Adds a subcommand whose job runs after all arguments are parsed. `examples` end its --help.
CLI::App* add_command(CLI::App& app, Session& session, const std::string& name, const std::string& purpose,
                      const std::string& examples, std::function<void()> job);

/// --series and --keep-slices.
void add_scan_options(CLI::App& command, ScanOptions& options);

// One file each.
void add_info(CLI::App& app, Session& session);
void add_phantom(CLI::App& app, Session& session);
void add_cast(CLI::App& app, Session& session);
void add_recast(CLI::App& app, Session& session);
void add_project(CLI::App& app, Session& session);
void add_segment(CLI::App& app, Session& session);
void add_vesselness(CLI::App& app, Session& session);
void add_render(CLI::App& app, Session& session);
void add_simulate(CLI::App& app, Session& session);
void add_compare(CLI::App& app, Session& session);
void add_view(CLI::App& app, Session& session);
void add_devices(CLI::App& app, Session& session);
void add_demo(CLI::App& app, Session& session);

/// `640x480` or `512x512x720`, every number 1 to 65536. Throws InputError naming `option`.
std::vector<std::int64_t> parse_sizes(const std::string& text, std::size_t count, const std::string& option);

/// `12.5,-30`. Throws InputError naming `option`.
std::vector<double> parse_numbers(const std::string& text, const std::string& option);

/// Makes a folder, and those above it, where there is none. Throws InputError with `name` in front.
void make_folder(const std::filesystem::path& folder, const std::string& name);

/// {"size", "spacing_mm", "origin_mm"}.
Json to_json(const VolumeGeometry& geometry);

/// {"width", "height", "layers", "radii_mm", "centre_mm"}, the last of row 0.
Json to_json(const MapGeometry& geometry);

}  // namespace xraycast::cli
