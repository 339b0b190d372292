#include "xraycast/blood_flow/tree_flow.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace xraycast {
namespace {

const Blood& checked(const Blood& blood) {
  check(blood);
  return blood;
}

/// Of arterial pressure at rest over the flow of the heart.
constexpr double kBody_mmHg = TreeFlow::kAortic_mmHg - TreeFlow::kVenous_mmHg;
constexpr double kWindkessel_s = 0.79 * 1.75;
/// Of the arterial compliance, such that the resistive index of a renal artery is 0.6 at rest (Tublin et al.,
/// AJR 180:885, 2003).
constexpr double kShareDownstream = 0.15;
/// Of a periphery's resistance: the characteristic impedance of its arteries, from which no wave is
/// reflected: rho c / A, with a pulse wave of 6 m/s and the velocity of Blood.
constexpr double kProximalShare = 0.09;
/// Kim et al.'s circuit with the shares of Sankaran et al., Ann Biomed Eng 40:2228, 2012.
constexpr double kArterialShare = 0.32, kMicroShare = 0.52, kVenousShare = 0.16;
constexpr double kArterialCompliance = 0.11, kWallCompliance = 0.89;
constexpr double kCoronary_s = 1.9;  // resistance by compliance: 39 mmHg s/ml and 0.048 ml/mmHg
constexpr double kLeft_mmHg = 120, kRight_mmHg = 25;  // systolic, of the ventricles

FlowLoss difference(const FlowLoss& to, const FlowLoss& from) {
  return {to.resistance - from.resistance, to.inertance - from.inertance,
          to.quadratic_loss - from.quadratic_loss, to.blocked - from.blocked};
}

}  // namespace

void check(const Blood& blood) {
  const double bpm = blood.heart_rate_bpm;
  if (!(bpm == 0 || (bpm >= kMinHeartRate_bpm && bpm <= kMaxHeartRate_bpm)))
    throw InputError("`heart_rate_bpm` {:g}: must be 0, for a steady flow, or {:g} to {:g}", bpm,
                     kMinHeartRate_bpm, kMaxHeartRate_bpm);
  constexpr double kFastest_mm_s = 2000, kLeast = 1e-3, kMost = 1e3;
  if (!(blood.root_velocity_mm_s > 0 && blood.root_velocity_mm_s <= kFastest_mm_s))
    throw InputError("`root_velocity_mm_s` {:g}: must be above 0 and at most {:g} mm/s",
                     blood.root_velocity_mm_s, kFastest_mm_s);
  for (const auto& [name, factor] : {std::pair{"coronary_resistance", blood.coronary_resistance},
                                     std::pair{"other_resistance", blood.other_resistance}})
    if (!(factor >= kLeast && factor <= kMost))
      throw InputError("`{}` {:g}: outlets need a resistance of {:g} to {:g} of that at rest", name, factor,
                       kLeast, kMost);
  if (blood.heart) check(*blood.heart, "`heart_waveform`");
}

TreeFlow::TreeFlow(const VesselTree& tree, const Blood& blood)
    : tree_(tree),
      heart_(checked(blood).heart ? Heartbeat(*blood.heart) : Heartbeat(blood.heart_rate_bpm)),
      output_ml_s_(heart_output_ml_s(blood)),
      rest_(rest_flow(tree, blood)),
      sacs_(sacs_of(tree)),
      beds_(sacs_.size()),
      divided_mm_(tree.branches().size()),
      upper_(tree.branches().size()),
      behind_(tree.branches().size()),
      share_(tree.branches().size(), 1),
      peak_ml_s_(tree.branches().size()),
      embolisation_(tree, rest_),
      network_(nodes_of(blood)) {
  for (std::size_t b = 0; b < upper_.size(); ++b) divide(b, 0.5 * tree.branches()[b].arc_length_mm.back());
  begin();
}

std::vector<FlowNode> TreeFlow::nodes_of(const Blood& blood) {
  const double body_resistance = kBody_mmHg / output_ml_s_, compliance = kWindkessel_s / body_resistance;
  std::vector<FlowNode> nodes{{.compliance = (1 - kShareDownstream) * compliance}};
  const auto root = static_cast<std::size_t>(tree_.root());
  constexpr double kNone = 1e-9;
  if (const double share = 1 - rest_.ml_s[root] / output_ml_s_; share > kNone) {
    const double resistance = body_resistance / share;
    nodes.push_back({.parent = 0,
                     .resistance = kProximalShare * resistance,
                     .compliance = kShareDownstream * share * compliance});
    nodes.push_back({.parent = 1, .resistance = (1 - kProximalShare) * resistance, .is_held = true});
  }
  for (const VesselBranch& branch : tree_.branches()) impedances_.emplace_back(branch);
  std::vector<double> rest_mmHg(tree_.branches().size());
  for (const int index : parents_first(tree_)) {
    const auto b = static_cast<std::size_t>(index);
    const VesselBranch& branch = tree_.branches()[b];
    const auto parent = static_cast<std::size_t>(branch.parent);
    const std::size_t from = branch.parent < 0 ? 0 : upper_[parent] + 1;
    upper_[b] = nodes.size();
    nodes.push_back({.parent = static_cast<int>(from), .resistance = 1, .is_pipe = true});
    nodes.push_back({.parent = static_cast<int>(upper_[b]), .resistance = 1, .is_pipe = true});
    // At rest in the healthy tree.
    const double drop_mmHg =
        rest_.ml_s[b] * VesselImpedance(branch, healthy_radii_mm(branch)).whole().resistance;
    rest_mmHg[b] = (branch.parent < 0 ? kAortic_mmHg : rest_mmHg[parent]) - drop_mmHg;
  }
  for (std::size_t b = 0; b < tree_.branches().size(); ++b)
    if (is_outlet(b))
      add_outlet(nodes, b, rest_mmHg[b],
                 rest_.coronary[b] == Coronary::none ? blood.other_resistance : blood.coronary_resistance);
  return nodes;
}

/// What follows a leaf, whose pressure at rest is given.
void TreeFlow::add_outlet(std::vector<FlowNode>& nodes, std::size_t branch, double mmHg, double factor) {
  // A tree so narrow that at rest nothing would be left of the pressure: its flow is lower then.
  constexpr double kLeast_mmHg = 10;
  const double resistance = (std::max(mmHg, kVenous_mmHg + kLeast_mmHg) - kVenous_mmHg) / rest_.ml_s[branch];
  behind_[branch] = nodes.size();
  const auto leaf = static_cast<int>(upper_[branch] + 1), first = static_cast<int>(nodes.size());
  const Coronary coronary = rest_.coronary[branch];
  if (coronary == Coronary::none) {
    const double compliance = kShareDownstream * kWindkessel_s * rest_.ml_s[branch] / kBody_mmHg;
    const double proximal = kProximalShare * resistance;
    nodes.push_back({.parent = leaf, .resistance = proximal, .compliance = compliance});
    nodes.push_back({.parent = first,
                     .resistance = factor * resistance - std::min(1.0, factor) * proximal,
                     .is_held = true});
    return;
  }
  const double compliance = kCoronary_s / resistance;
  nodes.push_back({.parent = leaf,
                   .resistance = kArterialShare * factor * resistance,
                   .compliance = kArterialCompliance * compliance});
  walls_.push_back({nodes.size(), coronary == Coronary::left ? kLeft_mmHg : kRight_mmHg});
  nodes.push_back({.parent = first,
                   .resistance = kMicroShare * factor * resistance,
                   .compliance = kWallCompliance * compliance});
  nodes.push_back({.parent = first + 1, .resistance = kVenousShare * factor * resistance, .is_held = true});
}

/// Puts a branch's inner node at a place.
void TreeFlow::divide(std::size_t branch, double arc_length_mm) {
  constexpr double kEnd = 0.01;  // of the branch; an element needs a length
  const double length_mm = tree_.branches()[branch].arc_length_mm.back();
  divided_mm_[branch] = std::clamp(arc_length_mm, kEnd * length_mm, (1 - kEnd) * length_mm);
  const FlowLoss before = impedances_[branch].up_to(divided_mm_[branch]);
  const FlowLoss behind = difference(impedances_[branch].whole(), before);
  const std::size_t node = upper_[branch];
  network_.set_element(node, before.resistance, before.inertance, before.quadratic_loss);
  network_.set_element(node + 1, behind.resistance, behind.inertance, behind.quadratic_loss);
  network_.set_conductance(node, before.blocked > 0 ? 0 : share_[branch]);
  network_.set_conductance(node + 1, behind.blocked > 0 ? 0 : share_[branch]);
}

/// What the heart does between two times: its flow's mean, and its walls' pressure at the end.
void TreeFlow::beat(double begin_s, double end_s) {
  network_.set_inflow(0, output_ml_s_ * heart_.mean_ejection(begin_s, end_s));
  for (const Wall& wall : walls_) network_.set_outside(wall.node, wall.most_mmHg * heart_.contraction(end_s));
}

/// Beats until one is like the other.
void TreeFlow::begin() {
  for (std::size_t i = 0; i < network_.size(); ++i)
    if (network_.is_held(i)) network_.set_outside(i, kVenous_mmHg);
  const auto settle = [&](double inflow_ml_s) {
    beat(0, 0);
    network_.set_inflow(0, inflow_ml_s);
    network_.settle();
  };
  settle(output_ml_s_);
  for (std::size_t b = 0; b < upper_.size(); ++b) peak_ml_s_[b] = std::abs(end_ml_s(b));
  if (heart_.is_steady()) return;
  constexpr int kBeats = 4;
  const int steps = static_cast<int>(std::ceil(heart_.period_s() / kLongestStep_s));
  const double step_s = heart_.period_s() / steps;
  double rest_mmHg = aortic_mmHg();
  for (int n = 0; n <= kBeats; ++n) {
    for (int i = 0; i < steps; ++i) {
      beat(step_s * i, step_s * (i + 1));
      network_.step(step_s);
      for (std::size_t b = 0; n == kBeats && b < upper_.size(); ++b)
        peak_ml_s_[b] = std::max({peak_ml_s_[b], std::abs(start_ml_s(b)), std::abs(end_ml_s(b))});
    }
    if (n > 0) continue;
    // The aorta goes to where it is as a beat begins by the windkessel's time constant: begin there.
    const double left = std::exp(-heart_.period_s() / kWindkessel_s);
    const double begin_mmHg = rest_mmHg + (aortic_mmHg() - rest_mmHg) / (1 - left);
    settle(output_ml_s_ * (begin_mmHg - kVenous_mmHg) / (rest_mmHg - kVenous_mmHg));
  }
}

void TreeFlow::step(double time_s, const VesselTree::Location& tip, double injection_ml_s,
                    const Particles& particles) {
  if (injected_) network_.set_inflow(*injected_, 0);
  injected_.reset();
  if (injection_ml_s > 0) {
    const auto branch = static_cast<std::size_t>(tip.branch);
    divide(branch, tip.arc_length_mm);
    injected_ = upper_[branch];
    network_.set_inflow(*injected_, injection_ml_s);
  }
  beat(time_s_, time_s_ + time_s);
  network_.step(time_s);
  time_s_ += time_s;
  const auto branch = static_cast<std::size_t>(tip.branch);
  const double count = injection_ml_s > 0 ? particles.per_ml() * injection_ml_s * time_s : 0;
  if (on_the_way_.count > 0 &&
      (count == 0 || on_the_way_.branch != branch || on_the_way_.diameter_mm != particles.diameter_mm))
    lodge();
  if (count > 0) carry(particles, count, branch, time_s);
}

void TreeFlow::carry(const Particles& particles, double count, std::size_t branch, double time_s) {
  OnTheWay& way = on_the_way_;
  way.count += count;
  way.diameter_mm = particles.diameter_mm;
  way.branch = branch;
  way.time_s += time_s;
  way.ml.start.resize(upper_.size());
  way.ml.end.resize(upper_.size());
  for (std::size_t b = 0; b < upper_.size(); ++b) {
    way.ml.start[b] += start_ml_s(b) * time_s;
    way.ml.end[b] += end_ml_s(b) * time_s;
  }
  if (heart_.is_steady() || way.time_s >= heart_.period_s()) lodge();
}

/// Where the blood of the heartbeat has gone.
void TreeFlow::lodge() {
  embolisation_.add(on_the_way_.count, on_the_way_.diameter_mm, on_the_way_.branch, on_the_way_.ml);
  on_the_way_ = {};
  for (std::size_t b = 0; b < upper_.size(); ++b)
    if (embolisation_.open_share(b) < 1) set_periphery(b, embolisation_.open_share(b));
}

double TreeFlow::sac_ml_s(std::size_t sac) const {
  const VesselBranch& dead_end = tree_.branches()[static_cast<std::size_t>(sacs_[sac].branch)];
  return sac_inflow_ml_s(sacs_[sac], end_ml_s(static_cast<std::size_t>(dead_end.parent)), beds_[sac]);
}

double TreeFlow::pressure_mmHg(const VesselTree::Location& place) const {
  const auto branch = static_cast<std::size_t>(place.branch);
  const std::size_t node = upper_[branch];
  const bool is_before = place.arc_length_mm <= divided_mm_[branch];
  // The viscous drop goes on with the resistance, the inertial one with it as well: they are small but at a
  // throat.
  const FlowLoss here = impedances_[branch].up_to(place.arc_length_mm),
                 middle = impedances_[branch].up_to(divided_mm_[branch]), whole = impedances_[branch].whole();
  const FlowLoss from = is_before ? FlowLoss{} : middle, to = is_before ? middle : whole;
  const std::size_t end = is_before ? node : node + 1;
  const double begin_mmHg = network_.pressure(network_.parent(end)), end_mmHg = network_.pressure(end);
  const double flow_ml_s = network_.flow(end), square = std::abs(flow_ml_s) * flow_ml_s;
  const double loss_mmHg = (to.quadratic_loss - from.quadratic_loss) * square;
  const double share = (here.resistance - from.resistance) / (to.resistance - from.resistance);
  return begin_mmHg - share * (begin_mmHg - end_mmHg - loss_mmHg) -
         (here.quadratic_loss - from.quadratic_loss) * square;
}

void TreeFlow::fill(const std::vector<Filling>& fillings) {
  std::vector<bool> changes(tree_.branches().size());
  for (const Filling& filling : fillings_) {
    impedances_[static_cast<std::size_t>(filling.branch)].empty();
    changes[static_cast<std::size_t>(filling.branch)] = true;
  }
  fillings_ = fillings;
  for (const Filling& filling : fillings_) {
    impedances_[static_cast<std::size_t>(filling.branch)].occupy(filling.from_mm, filling.to_mm,
                                                                 filling.radius_mm);
    changes[static_cast<std::size_t>(filling.branch)] = true;
  }
  for (std::size_t b = 0; b < changes.size(); ++b)
    if (changes[b]) divide(b, divided_mm_[b]);
}

void TreeFlow::set_lumen(std::size_t branch, const std::vector<double>& radii_mm) {
  impedances_[branch] = VesselImpedance(tree_.branches()[branch], radii_mm);
  for (const Filling& filling : fillings_)
    if (static_cast<std::size_t>(filling.branch) == branch)
      impedances_[branch].occupy(filling.from_mm, filling.to_mm, filling.radius_mm);
  divide(branch, divided_mm_[branch]);
}

void TreeFlow::set_lumens(const VesselTree& tree) {
  for (std::size_t b = 0; b < tree.branches().size(); ++b) {
    std::vector<double> radii_mm;
    for (const VesselPoint& point : tree.branches()[b].points) radii_mm.push_back(point.radius_mm);
    set_lumen(b, radii_mm);
  }
}

void TreeFlow::set_conductance(std::size_t branch, double share) {
  share_[branch] = share;
  divide(branch, divided_mm_[branch]);
}

void TreeFlow::set_periphery(std::size_t leaf, double share) {
  if (behind_[leaf] == 0) return;
  const std::size_t last = behind_[leaf] + (rest_.coronary[leaf] == Coronary::none ? 1 : 2);
  for (std::size_t node = behind_[leaf]; node <= last; ++node) network_.set_conductance(node, share);
}

}  // namespace xraycast
