#pragma once

#include "xraycast/base/error.hpp"
#include "xraycast/base/progress.hpp"
#include "xraycast/casting/map_geometry.hpp"
#include "xraycast/scan/scan.hpp"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <filesystem>
#include <functional>
#include <initializer_list>
#include <string>
#include <vector>

namespace xraycast::cli {

using Json = nlohmann::ordered_json;

/// State shared by all subcommands: the global options, the job's progress, and the job itself, which the
/// chosen subcommand sets while the arguments are parsed.
struct Invocation {
  std::string device;
  bool json = false;
  bool quiet = false;
  Progress progress;
  std::function<void()> job;
  const CLI::App* command = nullptr;  ///< the chosen subcommand
  bool is_ended_by_signal = false;    ///< the job, as it should be: nothing was cancelled

  explicit Invocation(Progress::Listener listener) : progress(std::move(listener)) {}

  /// A request's message, in which fields are named as options.
  std::string spelled(const std::string& message) const;

  /// Prints each line, spelled, on stderr, unless --quiet.
  void say(const std::vector<std::string>& lines) const;

  /// The same of a scan that was opened: its warnings, then its notes.
  void say_about(const ScanInfo& scan) const;

  /// The same of a scan's voxels, once they are read.
  void say_about(const SliceSource& voxels) const;

  /// Prints a result on stdout: the JSON with --json, else the text.
  void answer(const Json& result, const std::string& text) const;

  /// As answer(), for files that were written; --quiet drops the text.
  void report(const Json& result, const std::string& text) const;
};

/// Adds a subcommand whose job runs after all arguments are parsed. `examples` end its --help.
CLI::App* add_command(CLI::App& app, Invocation& invocation, const std::string& name,
                      const std::string& purpose, const std::string& examples, std::function<void()> job);

/// INPUT, the scan to read.
void add_scan_argument(CLI::App& command, std::string& input);

/// --series, --keep-slices, --skip-damaged and --offset-hu.
void add_scan_options(CLI::App& command, ScanOptions& options);

// One file each.
void add_info(CLI::App& app, Invocation& invocation);
void add_convert(CLI::App& app, Invocation& invocation);
void add_phantom(CLI::App& app, Invocation& invocation);
void add_cast(CLI::App& app, Invocation& invocation);
void add_recast(CLI::App& app, Invocation& invocation);
void add_project(CLI::App& app, Invocation& invocation);
void add_segment(CLI::App& app, Invocation& invocation);
void add_vessels(CLI::App& app, Invocation& invocation);
void add_edit(CLI::App& app, Invocation& invocation);
void add_motion(CLI::App& app, Invocation& invocation);
void add_register(CLI::App& app, Invocation& invocation);
void add_vesselness(CLI::App& app, Invocation& invocation);
void add_render(CLI::App& app, Invocation& invocation);
void add_flow(CLI::App& app, Invocation& invocation);
void add_simulate(CLI::App& app, Invocation& invocation);
void add_report(CLI::App& app, Invocation& invocation);
void add_export(CLI::App& app, Invocation& invocation);
void add_compare(CLI::App& app, Invocation& invocation);
void add_view(CLI::App& app, Invocation& invocation);
void add_serve(CLI::App& app, Invocation& invocation);
void add_devices(CLI::App& app, Invocation& invocation);
void add_demo(CLI::App& app, Invocation& invocation);

/// Throws InputError for the first of `options` that is given, although it has no effect: "OPTION does not
/// apply WHY".
void check_not_given(const CLI::App& command, std::initializer_list<const char*> options,
                     const std::string& why);

/// What `make` returns of an option's value; its InputError gets the option's name in front, and `hint`
/// behind.
template <typename Make>
auto for_option(const std::string& option, const Make& make, const std::string& hint = "") {
  try {
    return make();
  } catch (const InputError& error) {
    throw InputError("{} {}{}", option, error.what(), hint);
  }
}

/// `640x480` or `512x512x720`, every number 1 to 65536. Throws InputError naming `option`.
std::vector<std::int64_t> parse_sizes(const std::string& text, std::size_t count, const std::string& option);

/// `12.5,-30`. Throws InputError naming `option`.
std::vector<double> parse_numbers(const std::string& text, const std::string& option);

/// `12.5,-170,690`: a point in LPS mm. Throws InputError naming `option`.
glm::dvec3 parse_point(const std::string& text, const std::string& option);

/// Creates a folder and its parents unless they exist. Throws InputError with `name` in front.
void make_folder(const std::filesystem::path& folder, const std::string& name);

/// Creates the folder for the frames of a cine, as `make_folder`. Throws InputError, with `name` in front,
/// for one that does not exist and whose name has an ending, such as run.mp4: it means a file.
void make_frames_folder(const std::filesystem::path& folder, const std::string& name);

/// Called before long work whose results go into `folder`: throws InputError, with `name` in front, when the
/// folder cannot be created, and as check_writable when one of the files cannot be written. Creates nothing.
void check_folder(const std::filesystem::path& folder, const std::vector<const char*>& files,
                  const std::string& name);

/// {"size", "spacing_mm", "origin_mm"}.
Json to_json(const VolumeGeometry& geometry);

/// {"width", "height", "layers", "radii_mm", "centre_mm", "outline"}, the centre of row 0.
Json to_json(const MapGeometry& geometry);

}  // namespace xraycast::cli
