#include "options/command.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/field_names.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/base/stderr_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <string_view>
#include <unistd.h>
#include <utility>

namespace xraycast::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char *kSkipDamaged = "--skip-damaged", *kOffset = "--offset-hu";

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : text)
    if (c == separator)
      parts.emplace_back();
    else
      parts.back() += c;
  return parts;
}

bool is_one_file(const std::string& a, const std::string& b) {
  std::error_code error;
  return fs::equivalent(a, b, error) || fs::path(a).lexically_normal() == fs::path(b).lexically_normal();
}

/// Throws InputError when an output has the path of an input or of another output.
void check_outputs_apart(const CLI::App& command) {
  static constexpr std::array<std::string_view, 8> kOutputs{
      "--output", "--preview", "--keep-basis", "--plot", "--cine", "--truth", "--explain", "--report"};
  const auto& options = command.get_options();
  for (const CLI::Option* output : options) {
    if (output->empty() || std::ranges::find(kOutputs, output->get_name()) == kOutputs.end()) continue;
    for (const CLI::Option* other : options) {
      // Options with a list of values do not name files.
      if (other == output || other->get_type_name().find('{') != std::string::npos) continue;
      for (const std::string& file : other->results())
        if (is_one_file(output->results().front(), file))
          throw InputError("{} {}: is also given as {} and would overwrite it; choose another name",
                           output->get_name(), output->results().front(), other->get_name());
    }
  }
}

/// Lists that repeated options fill.
constexpr std::array<std::pair<std::string_view, const char*>, 4> kRepeated{
    {{"instruments", "device-model"}, {"labels", "label"}, {"not_vessels", "not"}, {"seeds", "seed"}}};

/// The option that sets a field of a request: `offset_hu` is --offset-hu, `radius_mm` is --radius. That of
/// another command where this one has none, as for how to cast the map of a page; empty where none has.
std::string option_of(const CLI::App& command, std::string_view field) {
  const auto* const repeated =
      std::ranges::find(kRepeated, field, &std::pair<std::string_view, const char*>::first);
  std::string name = fmt::format("--{}", repeated == kRepeated.end() ? field : repeated->second);
  std::ranges::replace(name, '_', '-');
  std::string without_unit = name;
  for (const std::string_view unit : {"-mm", "-hu", "-deg", "-ml-s", "-mg-ml", "-ml", "-s", "-B", "-bpm"})
    if (without_unit.ends_with(unit)) without_unit.erase(without_unit.size() - unit.size());
  std::vector<const CLI::App*> commands =
      command.get_parent()->get_subcommands([](const CLI::App*) { return true; });
  commands.insert(commands.begin(), &command);
  for (const CLI::App* one : commands)
    for (const std::string& option : {name, without_unit})
      if (one->get_option_no_throw(option)) return option;
  return "";
}

/// A request's message, in which fields are options.
std::string with_options(const CLI::App& command, std::string_view message) {
  return with_names(message, [&](std::string_view field) { return option_of(command, field); });
}

}  // namespace

std::string Invocation::spelled(const std::string& message) const {
  return command ? with_options(*command, message) : message;
}

void Invocation::say(const std::vector<std::string>& lines) const {
  if (quiet) return;
  for (const std::string& line : lines) log_to_stderr(spelled(line));
}

void Invocation::say_about(const ScanInfo& scan) const {
  say(scan.warnings);
  say(scan.notes);
}

void Invocation::say_about(const SliceSource& voxels) const { say(voxels.hu_range().warnings()); }

void Invocation::answer(const Json& result, const std::string& text) const {
  // Descriptions in scans and names of files may not be UTF-8, which JSON requires.
  std::cout << (json ? result.dump(2, ' ', false, Json::error_handler_t::replace) + '\n' : printable(text))
            << std::flush;
}

void Invocation::report(const Json& result, const std::string& text) const {
  answer(result, quiet ? "" : text);
}

CLI::App* add_command(CLI::App& app, Invocation& invocation, const std::string& name,
                      const std::string& purpose, const std::string& examples, std::function<void()> job) {
  CLI::App* command = app.add_subcommand(name, purpose);
  command->footer("Examples:\n" + examples);
  command->parse_complete_callback([&invocation, command, job = std::move(job)] {
    invocation.command = command;
    invocation.job = [command, job] {
      check_outputs_apart(*command);
      try {
        job();
      } catch (const DamagedSlice& error) {
        const CLI::Option* const skip = command->get_option_no_throw(kSkipDamaged);
        if (skip == nullptr || !skip->empty()) throw;
        throw InputError("{}, or leave damaged slices out by {}", error.what(), kSkipDamaged);
      } catch (const InputError& error) {
        throw InputError("{}", with_options(*command, error.what()));
      }
    };
  });
  return command;
}

void add_scan_argument(CLI::App& command, std::string& input) {
  command.add_option("INPUT", input, "The scan: a folder or a file (see `xraycast info`)")->required();
}

void add_scan_options(CLI::App& command, ScanOptions& options) {
  command
      .add_option("--series", options.series,
                  "DICOM series to read: its number, part of its description, or UID")
      ->type_name("TEXT");
  command.add_flag("--keep-slices", options.keep_slices,
                   "Reject unevenly spaced slices instead of resampling them");
  command.add_flag(kSkipDamaged, options.skip_damaged,
                   "Leave damaged slices out and interpolate across them");
  command
      .add_option(kOffset, options.offset_hu,
                  "Add this to all values: -1024 for a scan stored as HU + 1024, without negative values")
      ->type_name("HU");
}

void check_not_given(const CLI::App& command, std::initializer_list<const char*> options,
                     const std::string& why) {
  for (const char* option : options)
    if (command.count(option) > 0) throw InputError("{} does not apply {}", option, why);
}

std::vector<std::int64_t> parse_sizes(const std::string& text, std::size_t count, const std::string& option) {
  std::vector<std::int64_t> sizes;
  for (const std::string& part : split(text, 'x')) {
    std::int64_t size = 0;
    if (!parse_whole(part, size) || size < 1 || size > 65536)
      throw InputError("{} {}: must be {} numbers of 1 to 65536, joined by x", option, text, count);
    sizes.push_back(size);
  }
  if (sizes.size() != count) throw InputError("{} {}: must be {} numbers, joined by x", option, text, count);
  return sizes;
}

std::vector<double> parse_numbers(const std::string& text, const std::string& option) {
  std::vector<double> numbers;
  for (const std::string& part : split(text, ',')) {
    double number = 0;
    if (!parse_whole(part, number) || !std::isfinite(number))
      throw InputError("{} {}: '{}' is not a number", option, text, part);
    numbers.push_back(number);
  }
  return numbers;
}

glm::dvec3 parse_point(const std::string& text, const std::string& option) {
  const std::vector<double> numbers = parse_numbers(text, option);
  if (numbers.size() != 3) throw InputError("{} {}: must be X,Y,Z in mm (LPS)", option, text);
  return {numbers[0], numbers[1], numbers[2]};
}

void make_folder(const std::filesystem::path& folder, const std::string& name) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw InputError("{}: the folder cannot be created: {}", name, error.message());
}

void make_frames_folder(const std::filesystem::path& folder, const std::string& name) {
  std::error_code error;
  if (folder.has_extension() && !fs::is_directory(folder, error))
    throw InputError("{}: must be a folder for PNGs, whose name has no ending, or end in .gif or .dcm", name);
  make_folder(folder, folder.string());
}

void check_folder(const std::filesystem::path& folder, const std::vector<const char*>& files,
                  const std::string& name) {
  std::error_code error;
  if (fs::is_directory(folder, error)) {
    for (const char* file : files) check_writable(folder / file);
    return;
  }
  fs::path above = fs::absolute(folder);
  while (!fs::exists(fs::symlink_status(above, error)) && above.has_relative_path())
    above = above.parent_path();
  if (!fs::is_directory(above, error))
    throw InputError("{}: the folder cannot be created: {} is not a folder", name, above.string());
  if (access(above.c_str(), W_OK | X_OK) != 0)
    throw InputError("{}: the folder cannot be created in {}: {}", name, above.string(),
                     std::strerror(errno));
}

Json to_json(const VolumeGeometry& geometry) {
  const auto list = [](const auto& v) { return Json{v.x, v.y, v.z}; };
  return {{"size", list(geometry.size)},
          {"spacing_mm", list(geometry.spacing_mm)},
          {"origin_mm", list(geometry.origin_mm)}};
}

Json to_json(const MapGeometry& geometry) {
  const glm::dvec2 centre_mm = geometry.centre_of_row_mm(0);
  return {{"width", geometry.width},
          {"height", geometry.height},
          {"layers", geometry.layers()},
          {"radii_mm", geometry.radii_mm},
          {"centre_mm", {centre_mm.x, centre_mm.y}},
          {"outline", geometry.has_outline() ? "body" : "circle"}};
}

}  // namespace xraycast::cli
