#include "command.hpp"
#include "xraycast/error.hpp"
#include "xraycast/viewer/viewer_window.hpp"

#include <memory>
#include <optional>

namespace xraycast::cli {
namespace {

struct Options {
  std::string map, scan, basis, vessels, catheter, session;
  std::optional<double> contrast_mg_ml;
};

ViewSession resolve(const Options& options) {
  ViewSession session;
  if (!options.session.empty()) session = read_session(options.session);
  const std::pair<const std::string&, std::filesystem::path&> files[] = {
      {options.map, session.map},
      {options.scan, session.scan},
      {options.basis, session.basis},
      {options.vessels, session.vessels},
      {options.catheter, session.catheter}};
  for (const auto& [given, file] : files) {
    if (given.empty()) continue;
    if (!std::filesystem::exists(given)) throw InputError("{}: no such file or folder", given);
    file = given;
  }
  if (options.contrast_mg_ml) session.contrast_mg_ml = *options.contrast_mg_ml;
  return session;
}

}  // namespace

void add_view(CLI::App& app, Session& session) {
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      add_command(app, session, "view", "The interactive viewer",
                  "  xraycast view map.exr --basis map.basis --vessels thorax-truth\n"
                  "  xraycast view --scan scans/chest/\n"
                  "  xraycast view --session operation.json",
                  [options, &session] { run_viewer(resolve(*options), session.device, session.progress); });
  command->add_option("MAP", options->map, "The body map; without it, the scan is cast")
      ->type_name("MAP.exr");
  command->add_option("--scan", options->scan, "The scan, for true projections beside the map")
      ->type_name("INPUT");
  command->add_option("--basis", options->basis, "What the map is recast from while its opacity is edited")
      ->type_name("FILE");
  command->add_option("--vessels", options->vessels, "A surface (.vtp, .stl), or a folder that holds one")
      ->type_name("DIR|FILE");
  command
      ->add_option("--contrast", options->contrast_mg_ml,
                   "fluoro: iodine in the vessels' blood (default 50; undiluted agents have 350)")
      ->check(CLI::Range(0.0, kMostContrast_mg_ml))
      ->type_name("MG/ML");
  command->add_option("--catheter", options->catheter, "Control points x,y,z in mm of a catheter's curve")
      ->type_name("CSV");
  command->add_option("--session", options->session, "What was saved with Ctrl+S; other options go first")
      ->type_name("FILE");
}

}  // namespace xraycast::cli
