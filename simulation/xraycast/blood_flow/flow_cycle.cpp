#include "xraycast/blood_flow/flow_cycle.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/blood_flow/tree_flow.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace xraycast {
namespace {

VesselTree::Location end_of(const VesselTree& tree, std::size_t branch) {
  VesselTree::Location end;
  end.branch = static_cast<int>(branch);
  end.arc_length_mm = tree.branches()[branch].arc_length_mm.back();
  return end;
}

double mean_of(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

/// Steps of a beat, and how many there are; a steady flow has one second of them.
struct CycleSteps {
  int count;
  double step_s;
  explicit CycleSteps(const Heartbeat& heart)
      : count(static_cast<int>(std::ceil(heart.period_s() / FlowCycle::kStep_s))),
        step_s(heart.period_s() / count) {}
};

/// A tree may begin in an artery of the groin, and the heart does not.
std::vector<std::string> notes_on_root(const VesselTree& tree) {
  const auto is_aorta = [](const VesselBranch& branch) {
    return branch.name == "aorta" || branch.name.ends_with(" aorta");
  };
  const std::string& root = tree.branches()[static_cast<std::size_t>(tree.root())].name;
  if (!root.ends_with(" artery") || std::ranges::none_of(tree.branches(), is_aorta)) return {};
  return {fmt::format(
      "the tree's root is {}, and blood comes in there, although the tree has an aorta: make it anew with "
      "`root_mm` at the aorta's end",
      tree.title(tree.root()))};
}

}  // namespace

void check(const FlowRequest& request) {
  if (!request.tree)
    throw InputError("`tree`: missing; blood needs a vessel tree, such as `xraycast segment` writes");
  check(request.blood);
}

double FlowCycle::pressure_ratio(std::size_t branch) const {
  return mean_of(vessels[branch].mmHg) / mean_of(aortic_mmHg);
}

FlowCycle flow_cycle(const FlowRequest& request, Progress& progress) {
  check(request);
  const VesselTree& tree = *request.tree;
  TreeFlow flow(tree, request.blood);
  const CycleSteps steps(flow.heart());
  FlowCycle cycle;
  cycle.heart_ml_s = flow.heart_ml_s();
  cycle.notes = notes_on_root(tree);
  cycle.vessels.resize(tree.branches().size());
  progress.begin("blood flow", steps.count, "steps");
  for (int i = 0; i < steps.count; ++i) {
    progress.check();
    flow.step(steps.step_s, {}, 0);
    cycle.time_s.push_back(steps.step_s * (i + 1));
    cycle.aortic_mmHg.push_back(flow.aortic_mmHg());
    for (std::size_t b = 0; b < cycle.vessels.size(); ++b) {
      cycle.vessels[b].ml_s.push_back(flow.start_ml_s(b));
      cycle.vessels[b].mmHg.push_back(flow.pressure_mmHg(end_of(tree, b)));
    }
    for (std::size_t s = 0; s < flow.sacs().size(); ++s)
      cycle.vessels[static_cast<std::size_t>(flow.sacs()[s].branch)].ml_s.back() = flow.sac_ml_s(s);
    progress.advance();
  }
  return cycle;
}

CycleFigures figures_of(const std::vector<double>& values) {
  const auto [least, most] = std::minmax_element(values.begin(), values.end());
  return {mean_of(values), *least, *most};
}

double fractional_flow_reserve(const VesselTree& tree, const VesselTree::Location& place, Blood blood) {
  blood.coronary_resistance = kHyperaemia;
  TreeFlow flow(tree, blood);
  const CycleSteps steps(flow.heart());
  double distal_mmHg = 0, aortic_mmHg = 0;
  for (int i = 0; i < steps.count; ++i) {
    flow.step(steps.step_s, {}, 0);
    distal_mmHg += flow.pressure_mmHg(place);
    aortic_mmHg += flow.aortic_mmHg();
  }
  return distal_mmHg / aortic_mmHg;
}

std::string to_csv(const FlowCycle& cycle, const VesselTree& tree) {
  std::string csv =
      "branch,vessel,flow_ml_s,least_flow_ml_s,most_flow_ml_s,share,mean_mmHg,least_mmHg,most_mmHg,pressure_"
      "ratio\n";
  for (std::size_t b = 0; b < cycle.vessels.size(); ++b) {
    const CycleFigures flow = figures_of(cycle.vessels[b].ml_s), pressure = figures_of(cycle.vessels[b].mmHg);
    csv +=
        fmt::format("{},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g}\n", b,
                    tree.branches()[b].name, flow.mean, flow.least, flow.most, flow.mean / cycle.heart_ml_s,
                    pressure.mean, pressure.least, pressure.most, cycle.pressure_ratio(b));
  }
  return csv;
}

}  // namespace xraycast
