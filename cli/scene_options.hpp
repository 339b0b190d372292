#pragma once

#include "xraycast/scene/session_file.hpp"

#include <CLI/CLI.hpp>

#include <optional>
#include <string>

namespace xraycast::cli {

/// What is drawn within the body: --vessels, --contrast and --catheter, as given.
struct SceneOptions {
  std::string vessels, catheter;
  std::optional<double> contrast_mg_ml;
};

void add_scene_options(CLI::App& command, SceneOptions& options);

/// Puts what was given in the place of what the session has. Throws InputError for a file that is not there.
void apply(const SceneOptions& options, ViewSession& session);

/// A file of the session is another one, if one was given. Throws InputError when it is not there.
void replace_file(std::filesystem::path& file, const std::string& given);

}  // namespace xraycast::cli
