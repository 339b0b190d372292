#include "command.hpp"
#include "plot.hpp"
#include "xraycast/atomic_file.hpp"
#include "xraycast/error.hpp"
#include "xraycast/run_script.hpp"
#include "xraycast/stopwatch.hpp"
#include "xraycast/whole_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <memory>

namespace xraycast::cli {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string tree, device_model, script, log, plot, entry;
};

void plot_loads(const std::vector<RunRecord>& records, const std::string& device, const fs::path& path) {
  Curve force{"force, N", {}}, torque{"torque, N mm", {}};
  for (const RunRecord& record : records) {
    force.points.emplace_back(record.time_s, record.load.force_N);
    torque.points.emplace_back(record.time_s, 1e3 * record.load.torque_Nm);
  }
  write_plot(fmt::format("{}: at the hub", device), "time (s)", "load", {force, torque}, path);
}

void simulate(const Options& options, Session& session) {
  check_writable(options.log);
  if (!options.plot.empty()) check_writable(options.plot);
  const DeviceModel device = DeviceModel::named(options.device_model);
  const Script script = Script::read(options.script);
  const fs::path file =
      fs::is_directory(options.tree) ? fs::path(options.tree) / "tree.vtp" : fs::path(options.tree);
  const VesselTree tree = read_tree(file);
  const VesselEnd entry = entry_named(tree, options.entry);

  Catheter catheter(tree, device, entry);
  const Stopwatch stopwatch;
  const std::vector<RunRecord> records = run_script(catheter, script, options.script, session.progress);
  const double wall_s = 1e-3 * stopwatch.ms();
  write_whole_file(options.log, to_csv(records));
  if (!options.plot.empty()) plot_loads(records, device.name(), options.plot);

  const CatheterTip tip = catheter.tip();
  const double times_faster = catheter.time_s() / std::max(wall_s, 1e-9);
  session.print(
      {{"tree", file.string()},
       {"device_model", device.name()},
       {"entry_branch", entry.branch},
       {"log", options.log},
       {"rows", records.size()},
       {"simulated_s", catheter.time_s()},
       {"wall_s", wall_s},
       {"tip",
        {{"branch", tip.branch},
         {"arc_length_mm", tip.arc_length_mm},
         {"position_mm", {tip.position_mm.x, tip.position_mm.y, tip.position_mm.z}}}}},
      fmt::format("{}: {} rows, {:.1f} s in {:.1f} s ({:.1f} times real time); the tip is in branch {} at "
                  "{:.0f} mm\n",
                  options.log, records.size(), catheter.time_s(), wall_s, times_faster, tip.branch,
                  tip.arc_length_mm));
}

}  // namespace

void add_simulate(CLI::App& app, Session& session) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = add_command(
      app, session, "simulate", "Push and turn a catheter through a vessel tree, without a display",
      "  xraycast simulate vessels/tree.vtp --device-model cobra-5f --script push.csv -o log.csv\n"
      "  xraycast simulate vessels/tree.vtp --device-model guidewire-035-j --script push.csv -o log.csv \\\n"
      "    --entry 19 --plot forces.png\n"
      "A script is a CSV file: time_s,insertion_mm,rotation_deg in its first line, then numbers.",
      [options, &session] { simulate(*options, session); });
  command->add_option("TREE", options->tree, "The vessel tree (.vtp or .json), or a folder with a tree.vtp")
      ->required()
      ->type_name("TREE");
  command
      ->add_option("--device-model", options->device_model,
                   fmt::format("{}, or FILE.json", fmt::join(DeviceModel::preset_names(), ", ")))
      ->required()
      ->type_name("NAME");
  command->add_option("--script", options->script, "How the hub moves; linear between rows")
      ->required()
      ->type_name("CSV");
  command->add_option("-o,--output", options->log, "The log: a row for each row of the script, SI at the hub")
      ->required()
      ->type_name("CSV");
  command
      ->add_option(
          "--entry", options->entry,
          "The vessel end it enters at: a branch's number, or the one nearest to a point. Without: the "
          "most inferior one")
      ->type_name("BRANCH|X,Y,Z");
  command->add_option("--plot", options->plot, "The hub's force and torque over time")->type_name("PNG");
}

}  // namespace xraycast::cli
