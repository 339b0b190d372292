#pragma once

#include "xraycast/scene/session_file.hpp"

#include <CLI/CLI.hpp>

#include <optional>
#include <string>

namespace xraycast::cli {

/// Objects drawn inside the body: --vessels, --contrast and --catheter, as given.
struct SceneOptions {
  std::string vessels, catheter;
  std::optional<double> contrast_mg_ml;
};

void add_scene_options(CLI::App& command, SceneOptions& options);

/// Overrides the session's values with the given options. Throws InputError for a file that does not exist.
void apply(const SceneOptions& options, ViewSession& session);

/// Replaces a file of the session if one was given. Throws InputError when it does not exist.
void replace_file(std::filesystem::path& file, const std::string& given);

}  // namespace xraycast::cli
