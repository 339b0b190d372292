#include "command.hpp"
#include "xraycast/error.hpp"
#include "xraycast/viewer/viewer_window.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <memory>
#include <optional>

namespace xraycast::cli {
namespace {

struct Options {
  std::string map, scan, basis, vessels, catheter, session;
  std::optional<double> contrast_mg_ml;
  bool simulate = false;
  Intervention::Options simulation;
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

void view(const Options& options, const Session& session) {
  const ViewSession scene = resolve(options);
  std::optional<Intervention::Options> simulation;
  if (options.simulate || !options.simulation.script.empty()) {
    simulation = options.simulation;
    simulation->vessels = scene.vessels;
  }
  run_viewer(scene, session.device, session.progress, simulation);
}

}  // namespace

void add_view(CLI::App& app, Session& session) {
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      add_command(app, session, "view", "The interactive viewer",
                  "  xraycast view map.exr --basis map.basis --vessels thorax-truth\n"
                  "  xraycast view --scan scans/chest/\n"
                  "  xraycast view map.exr --vessels vessels --simulate --device-model simmons2-5f\n"
                  "  xraycast view --session operation.json",
                  [options, &session] { view(*options, session); });
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
  command->add_flag("--simulate", options->simulate, "Steer a catheter through the tree of --vessels");
  Intervention::Options& simulation = options->simulation;
  command
      ->add_option(
          "--device-model", simulation.device_model,
          fmt::format("What is steered: {}, or FILE.json", fmt::join(DeviceModel::preset_names(), ", ")))
      ->capture_default_str()
      ->type_name("NAME");
  command
      ->add_option(
          "--entry", simulation.entry,
          "The vessel end it enters at: a branch's number, or the one nearest to a point (default: the "
          "most inferior one)")
      ->type_name("BRANCH|X,Y,Z");
  command->add_option("--haptic", simulation.haptic, "What holds the hub")
      ->check(CLI::IsMember(Intervention::haptic_names()))
      ->capture_default_str()
      ->type_name("DEVICE");
  command
      ->add_option("--listen", simulation.listen, "openigtlink: where it listens (default 127.0.0.1:18944)")
      ->type_name("ADDRESS:PORT");
  command->add_option("--script", simulation.script, "Let a script steer (see `xraycast simulate`)")
      ->type_name("CSV");
  command->add_option("--session", options->session, "What was saved with Ctrl+S; other options go first")
      ->type_name("FILE");
}

}  // namespace xraycast::cli
