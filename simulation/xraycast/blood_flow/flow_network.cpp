#include "xraycast/blood_flow/flow_network.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

constexpr std::array kZerosOfJ0{2.404825557695773, 5.520078110286311};

/// Shares of a pipe's conductance in steady flow, 32 / z^4, and of its flow under a sudden pressure, 4 / z^2;
/// of the last mode what is left of both.
struct PipeShares {
  std::array<double, 3> steady{}, sudden{};
  constexpr PipeShares() {
    steady[2] = sudden[2] = 1;
    for (std::size_t m = 0; m < kZerosOfJ0.size(); ++m) {
      const double z2 = kZerosOfJ0[m] * kZerosOfJ0[m];
      steady[m] = 32 / (z2 * z2);
      sudden[m] = 4 / z2;
      steady[2] -= steady[m];
      sudden[2] -= sudden[m];
    }
  }
};
constexpr PipeShares kPipe;

void check_node(const FlowNode& node, std::size_t index) {
  for (const auto& [name, value] :
       {std::pair{"resistance", node.resistance}, std::pair{"inertance", node.inertance},
        std::pair{"quadratic_loss", node.quadratic_loss}, std::pair{"compliance", node.compliance}})
    if (!(value >= 0 && std::isfinite(value)))
      throw InputError("node {}: `{}` {:g}; give a finite number of 0 or more", index, name, value);
  if (index == 0) {
    if (node.parent != -1) throw InputError("node 0: `parent` {}; the first node has none, -1", node.parent);
    return;
  }
  if (node.parent < 0 || static_cast<std::size_t>(node.parent) >= index)
    throw InputError("node {}: `parent` {}; give the index of an earlier node", index, node.parent);
  if (node.resistance == 0 && node.inertance == 0)
    throw InputError("node {}: neither `resistance` nor `inertance`; give one above 0", index);
}

}  // namespace

FlowNetwork::FlowNetwork(std::vector<FlowNode> nodes) : nodes_(std::move(nodes)) {
  if (nodes_.empty()) throw InputError("a network without nodes; give at least one");
  bool has_outlet = false;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    check_node(nodes_[i], i);
    has_outlet = has_outlet || nodes_[i].is_held || nodes_[i].compliance > 0;
  }
  if (!has_outlet)
    throw InputError(
        "a network without an outlet; hold a pressure behind a resistance, or give a compliance");
  const std::size_t count = nodes_.size();
  for (auto* values : {&inflow_, &inflow_before_, &entering_, &given_, &before_, &stored_, &stored_from_,
                       &pressure_, &flow_, &mean_flow_, &viscous_conductance_, &viscous_drive_, &conductance_,
                       &drive_, &outside_, &admittance_, &source_, &diagonal_, &balance_})
    values->assign(count, 0);
  for (auto* modes : {&mode_resistance_, &mode_inertance_, &mode_flow_, &mode_from_, &gain_, &kept_})
    modes->assign(count, Modes{});
  share_.assign(count, 1);
  for (std::size_t i = 1; i < count; ++i) set_constants(i);
}

void FlowNetwork::set_element(std::size_t node, double resistance, double inertance, double quadratic_loss) {
  FlowNode& changed = nodes_[node];
  changed.resistance = resistance;
  changed.inertance = inertance;
  changed.quadratic_loss = quadratic_loss;
  set_constants(node);
}

void FlowNetwork::set_constants(std::size_t node) {
  const FlowNode& element = nodes_[node];
  has_losses_ = has_losses_ || element.quadratic_loss > 0;
  if (!element.is_pipe) {
    mode_resistance_[node][0] = element.resistance;
    mode_inertance_[node][0] = element.inertance;
  }
  for (std::size_t m = 0; element.is_pipe && m < kModes; ++m) {
    mode_inertance_[node][m] = element.inertance / kPipe.sudden[m];
    mode_resistance_[node][m] = element.resistance / kPipe.steady[m];
  }
  set_gains(node);
}

void FlowNetwork::set_conductance(std::size_t node, double share) {
  share_[node] = share;
  set_gains(node);
}

/// What a mode's flow takes over from the pressure, and from its own flow before, in a stage that lasts for a
/// time.
void FlowNetwork::set_stage(double time) {
  if (time == stage_) return;
  stage_ = time;
  for (std::size_t i = 1; i < nodes_.size(); ++i) set_gains(i);
}

void FlowNetwork::set_gains(std::size_t node) {
  viscous_conductance_[node] = 0;
  const std::size_t modes = nodes_[node].is_pipe ? kModes : 1;
  for (std::size_t m = 0; m < modes && stage_ > 0; ++m) {
    const double scale = 1 / (mode_inertance_[node][m] + stage_ * mode_resistance_[node][m]);
    gain_[node][m] = share_[node] * stage_ * scale;
    kept_[node][m] = share_[node] > 0 ? mode_inertance_[node][m] * scale : 0;
    viscous_conductance_[node] += gain_[node][m];
  }
}

/// The modes of each element as one conductance and one flow that goes on by itself.
void FlowNetwork::condense() {
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    admittance_[i] = nodes_[i].compliance / stage_;
    source_[i] = stored_from_[i] / stage_ + admittance_[i] * outside_[i] + entering_[i];
    viscous_drive_[i] = 0;
    for (std::size_t m = 0; m < kModes; ++m) viscous_drive_[i] += kept_[i][m] * mode_from_[i][m];
  }
}

/// Newton's tangent of the quadratic losses at the present flows.
void FlowNetwork::linearise() {
  conductance_ = viscous_conductance_;
  drive_ = viscous_drive_;
  for (std::size_t i = 1; has_losses_ && i < nodes_.size(); ++i) {
    if (nodes_[i].quadratic_loss == 0) continue;
    const double slope = 2 * nodes_[i].quadratic_loss * std::abs(flow_[i]);
    const double g = viscous_conductance_[i], reduction = 1 / (1 + g * slope);
    conductance_[i] = reduction * g;
    drive_[i] = reduction * (viscous_drive_[i] + 0.5 * g * slope * flow_[i]);
  }
}

/// From the ends to the first node: what flows into a subtree is linear in the pressure at its beginning.
void FlowNetwork::eliminate() {
  diagonal_ = admittance_;
  balance_ = source_;
  for (std::size_t i = nodes_.size() - 1; i > 0; --i) {
    const auto parent = static_cast<std::size_t>(nodes_[i].parent);
    const double g = conductance_[i];
    if (nodes_[i].is_held) {
      diagonal_[parent] += g;
      balance_[parent] += g * pressure_[i] - drive_[i];
      continue;
    }
    const double sum = diagonal_[i] + g;
    if (sum <= 0) continue;  // closed at both ends
    diagonal_[parent] += g * diagonal_[i] / sum;
    balance_[parent] += (g * balance_[i] - drive_[i] * diagonal_[i]) / sum;
  }
}

/// Back to the ends; true where no flow changes any more. Flows are summed up from the ends, so that what
/// enters a node leaves it to rounding, however large its elements' conductances.
bool FlowNetwork::substitute() {
  if (!nodes_[0].is_held && diagonal_[0] > 0) pressure_[0] = balance_[0] / diagonal_[0];
  for (std::size_t i = 1; i < nodes_.size(); ++i) {
    const double sum = diagonal_[i] + conductance_[i];
    if (nodes_[i].is_held || sum <= 0) continue;
    const double before = pressure_[static_cast<std::size_t>(nodes_[i].parent)];
    pressure_[i] = (conductance_[i] * before + drive_[i] + balance_[i]) / sum;
  }
  constexpr double kConverged = 1e-10;
  double largest = 0, changed = 0;
  std::vector<double>& leaving = balance_;  // not needed any more
  for (std::size_t i = 0; i < nodes_.size(); ++i) leaving[i] = admittance_[i] * pressure_[i] - source_[i];
  for (std::size_t i = nodes_.size() - 1; i > 0; --i) {
    const auto parent = static_cast<std::size_t>(nodes_[i].parent);
    const double across = conductance_[i] * (pressure_[parent] - pressure_[i]) + drive_[i];
    const double flow = nodes_[i].is_held ? across : conductance_[i] > 0 ? leaving[i] : 0;
    if (nodes_[i].quadratic_loss > 0) changed = std::max(changed, std::abs(flow - flow_[i]));
    largest = std::max(largest, std::abs(flow));
    flow_[i] = flow;
    leaving[parent] += flow;
  }
  return changed <= kConverged * largest;
}

/// A stage that lasts for a time, from where the modes' flows and what is stored begin.
void FlowNetwork::solve(double time) {
  constexpr int kMostIterations = 50;
  set_stage(time);
  condense();
  for (int i = 0; i < kMostIterations; ++i) {
    linearise();
    eliminate();
    if (substitute() || !has_losses_) break;
  }
  take_state();
}

void FlowNetwork::take_state() {
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    stored_[i] = nodes_[i].is_held ? 0 : nodes_[i].compliance * (pressure_[i] - outside_[i]);
    if (i == 0) continue;
    const double drop = pressure_[static_cast<std::size_t>(nodes_[i].parent)] - pressure_[i] -
                        nodes_[i].quadratic_loss * std::abs(flow_[i]) * flow_[i];
    for (std::size_t m = 0; m < kModes; ++m)
      mode_flow_[i][m] = gain_[i][m] * drop + kept_[i][m] * mode_from_[i][m];
  }
}

void FlowNetwork::settle() {
  constexpr double kEver = 1e9;  // times any time constant
  for (std::size_t i = 0; i < nodes_.size(); ++i) (nodes_[i].is_held ? pressure_ : outside_)[i] = given_[i];
  before_ = given_;
  entering_ = inflow_before_ = inflow_;
  mode_from_ = mode_flow_;
  stored_from_ = stored_;
  solve(kEver);
  mean_flow_ = flow_;
}

void FlowNetwork::step(double time) {
  constexpr double kStage = 0.2928932188134524;  // 1 - 1 / sqrt(2), of the step
  const auto give = [&](double at) {
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      (nodes_[i].is_held ? pressure_ : outside_)[i] = std::lerp(before_[i], given_[i], at);
      entering_[i] = std::lerp(inflow_before_[i], inflow_[i], at);
    }
  };
  // The first stage begins at the state; the second at where the first one's rates lead in the rest of the
  // step.
  mode_from_ = mode_flow_;
  stored_from_ = stored_;
  give(kStage);
  solve(kStage * time);
  constexpr double kOn = (1 - kStage) / kStage;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    mean_flow_[i] = (1 - kStage) * flow_[i];
    stored_from_[i] += kOn * (stored_[i] - stored_from_[i]);
    for (std::size_t m = 0; m < kModes; ++m) mode_from_[i][m] += kOn * (mode_flow_[i][m] - mode_from_[i][m]);
  }
  give(1);
  solve(kStage * time);
  for (std::size_t i = 0; i < nodes_.size(); ++i) mean_flow_[i] += kStage * flow_[i];
  before_ = given_;
  inflow_before_ = inflow_;
}

}  // namespace xraycast
