#pragma once

#include "options/command.hpp"
#include "xraycast/scene/session_file.hpp"

#include <CLI/CLI.hpp>

#include <optional>
#include <string>
#include <vector>

namespace xraycast::cli {

/// What is drawn inside the body: --vessels, --contrast, --catheter and --object, as given.
struct SceneOptions {
  std::string vessels, catheter;
  std::vector<std::string> objects;
  std::optional<double> contrast_mg_ml;
};

void add_scene_options(CLI::App& command, SceneOptions& options);

/// --object alone.
void add_object_option(CLI::App& command, std::vector<std::string>& objects);
std::vector<ImplantRequest> parse_objects(const std::vector<std::string>& objects);

/// Reads them, and says what is to be said of them. Throws as read_implants.
std::vector<Implant> open_objects(const std::vector<ImplantRequest>& objects, const Invocation& invocation);

/// Overrides the session's values with the given options. Throws InputError for a file that does not exist.
void apply(const SceneOptions& options, ViewSession& session);

/// The session in `session_file`, if one is named, with the given map and objects in place of its own. Throws
/// InputError when it has no map then, and as apply().
ViewSession resolve_scene(const std::string& session_file, const std::string& map,
                          const SceneOptions& options);

/// Replaces a file of the session if one was given. Throws InputError when it does not exist.
void replace_file(std::filesystem::path& file, const std::string& given);

}  // namespace xraycast::cli
