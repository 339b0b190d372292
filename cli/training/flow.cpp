#include "options/command.hpp"
#include "options/heart_options.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/blood_flow/flow_cycle.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>

namespace xraycast::cli {
namespace {

struct FlowArguments {
  std::string tree, table;
  HeartOptions heart;
  bool hyperaemia = false;
};

Json json_of(const CycleFigures& figures) {
  return {{"mean", figures.mean}, {"least", figures.least}, {"most", figures.most}};
}

Json json_of(const FlowCycle& cycle, const VesselTree& tree) {
  Json json{{"aortic_mmHg", json_of(figures_of(cycle.aortic_mmHg))},
            {"vessels", Json::array()},
            {"notes", cycle.notes}};
  for (std::size_t b = 0; b < cycle.vessels.size(); ++b)
    json["vessels"].push_back({{"branch", b},
                               {"vessel", tree.branches()[b].name},
                               {"flow_ml_s", json_of(figures_of(cycle.vessels[b].ml_s))},
                               {"pressure_mmHg", json_of(figures_of(cycle.vessels[b].mmHg))},
                               {"pressure_ratio", cycle.pressure_ratio(b)}});
  return json;
}

/// Its title, with its number where other branches have the same.
std::string told_apart(const VesselTree& tree, std::size_t branch) {
  const std::vector<VesselBranch>& branches = tree.branches();
  const std::string& name = branches[branch].name;
  const auto count = std::ranges::count(branches, name, &VesselBranch::name);
  return name.empty() || count == 1 ? tree.title(static_cast<int>(branch))
                                    : fmt::format("{} (branch {})", name, branch);
}

std::string text_of(const FlowCycle& cycle, const VesselTree& tree) {
  const CycleFigures aorta = figures_of(cycle.aortic_mmHg);
  std::string text =
      fmt::format("aorta: {:.0f}/{:.0f} mmHg, mean {:.0f}\n", aorta.most, aorta.least, aorta.mean);
  for (std::size_t b = 0; b < cycle.vessels.size(); ++b) {
    const CycleFigures flow = figures_of(cycle.vessels[b].ml_s), pressure = figures_of(cycle.vessels[b].mmHg);
    text += fmt::format("{}: {:.2f} ml/s, {:.0f}/{:.0f} mmHg, mean {:.0f}, {:.2f} of the aorta's\n",
                        told_apart(tree, b), flow.mean, pressure.most, pressure.least, pressure.mean,
                        cycle.pressure_ratio(b));
  }
  return text;
}

void flow(const FlowArguments& options, Invocation& invocation) {
  if (!options.table.empty()) check_writable(options.table);
  FlowRequest request{std::make_shared<const VesselTree>(read_tree(options.tree)),
                      parse_heart(options.heart)};
  if (options.hyperaemia) request.blood.coronary_resistance = kHyperaemia;
  const FlowCycle cycle = flow_cycle(request, invocation.progress);
  invocation.say(cycle.notes);
  if (!options.table.empty()) {
    OutputSet outputs;
    write_whole_file(options.table, to_csv(cycle, *request.tree));
    outputs.commit();
  }
  invocation.answer(json_of(cycle, *request.tree), text_of(cycle, *request.tree));
}

}  // namespace

void add_flow(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<FlowArguments>();
  CLI::App* command = add_command(app, invocation, "flow",
                                  "Tell how the blood flows through a vessel tree, and its pressures",
                                  "  xraycast flow vessels\n"
                                  "  xraycast flow coronaries/tree.json --hyperaemia -o reserve.csv\n"
                                  "  xraycast flow vessels --heart-waveform ascending-aorta.csv\n"
                                  "Pressures are those at the vessels' ends. With --hyperaemia their ratios "
                                  "to the aorta's are fractional flow\n"
                                  "reserves.",
                                  [options, &invocation] { flow(*options, invocation); });
  command->add_option("TREE", options->tree, "The vessel tree (.vtp or .json), or a folder with one")
      ->required()
      ->type_name("TREE");
  command->add_option("-o,--output", options->table, "Write a table too, a line a branch")->type_name("CSV");
  add_heart_options(*command, options->heart);
  command->add_flag("--hyperaemia", options->hyperaemia,
                    "The coronary periphery has the least resistance, as by adenosine");
}

}  // namespace xraycast::cli
