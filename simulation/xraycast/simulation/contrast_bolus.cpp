#include "xraycast/simulation/contrast_bolus.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

namespace xraycast {
namespace {

constexpr double kMl_s_per_mm3_s = 1e-3;
constexpr double kShortestStep_s = 5e-4;

std::vector<int> parents_first(const VesselTree& tree) {
  std::vector<int> order{tree.root()};
  for (std::size_t i = 0; i < order.size(); ++i)
    for (const int child : tree.branches()[static_cast<std::size_t>(order[i])].children)
      order.push_back(child);
  return order;
}

/// A child starts at its parent's end; a little further on it has its own width.
double own_radius_mm(const VesselBranch& branch) { return branch.points[branch.points.size() / 2].radius_mm; }

/// The radius over the thickness of the boundary layer that oscillates with the heart.
double womersley_number(double radius_mm, double heart_rate_bpm) {
  constexpr double kViscosity_mm2_s = 3.3;  // kinematic, of blood: 3.5 mPa s over 1.06 g/ml
  return radius_mm * std::sqrt(2 * std::numbers::pi * heart_rate_bpm / 60 / kViscosity_mm2_s);
}

double profile_exponent(const VesselBranch& branch, const Blood& blood) {
  constexpr double kParabola = 2, kBluntest = 9;
  if (blood.profile_exponent > 0) return blood.profile_exponent;
  return std::clamp(womersley_number(own_radius_mm(branch), blood.heart_rate_bpm), kParabola, kBluntest);
}

}  // namespace

ContrastBolus::ContrastBolus(const VesselTree& tree, const Blood& blood)
    : tree_(tree),
      blood_(blood),
      waveform_(blood.heart_rate_bpm),
      order_(parents_first(tree)),
      blood_ml_s_(tree.branches().size()),
      junctions_(tree.branches().size() + 1),
      is_upstream_(tree.branches().size()) {
  divide_flow();
  for (std::size_t b = 0; b < tree.branches().size(); ++b) {
    const VesselBranch& branch = tree.branches()[b];
    const double n = profile_exponent(branch, blood);
    const double fastest_ml_s = (n + 2) / n * waveform_.peak() * blood_ml_s_[b];
    vessels_.emplace_back(branch, n, blood.diffusivity_mm2_s, kShortestStep_s * fastest_ml_s);
    iodine_mg_ml_.emplace_back(branch.points.size() - 1);
  }
}

void ContrastBolus::divide_flow() {
  const auto& branches = tree_.branches();
  const auto root = static_cast<std::size_t>(tree_.root());
  const double radius_mm = branches[root].points.front().radius_mm;
  blood_ml_s_[root] = kMl_s_per_mm3_s * std::numbers::pi * radius_mm * radius_mm * blood_.root_velocity_mm_s;
  const auto share = [&](int child) {
    return std::pow(own_radius_mm(branches[static_cast<std::size_t>(child)]), blood_.split_exponent);
  };
  for (const int branch : order_) {
    const auto& children = branches[static_cast<std::size_t>(branch)].children;
    double all = 0;
    for (const int child : children) all += share(child);
    for (const int child : children)
      blood_ml_s_[static_cast<std::size_t>(child)] =
          blood_ml_s_[static_cast<std::size_t>(branch)] * share(child) / all;
  }
}

void ContrastBolus::place_source(const VesselTree::Location& tip, double ml_s, double mg_ml) {
  is_upstream_.assign(is_upstream_.size(), false);
  injected_branch_ = ml_s > 0 ? tip.branch : -1;
  if (ml_s <= 0) return;
  const auto branch = static_cast<std::size_t>(tip.branch);
  source_ = {vessels_[branch].cell_at(tip.arc_length_mm), ml_s, mg_ml};
  for (int b = tree_.branches()[branch].parent; b >= 0;
       b = tree_.branches()[static_cast<std::size_t>(b)].parent)
    is_upstream_[static_cast<std::size_t>(b)] = true;
}

double ContrastBolus::longest_step_s() const {
  double longest_s = std::numeric_limits<double>::infinity();
  for (std::size_t b = 0; b < vessels_.size(); ++b) {
    // On either side of a source there may be outflow.
    const bool is_displaced = is_upstream_[b] || injected_branch_ == static_cast<int>(b);
    const double flow_ml_s = waveform_.peak() * blood_ml_s_[b] + (is_displaced ? source_.ml_s : 0);
    longest_s = std::min(longest_s, vessels_[b].longest_step_s(flow_ml_s));
  }
  return longest_s;
}

void ContrastBolus::set_flow(double relative_flow) {
  for (std::size_t b = 0; b < vessels_.size(); ++b) {
    const double displaced_ml_s = is_upstream_[b] ? source_.ml_s : 0;
    vessels_[b].set_flow(relative_flow * blood_ml_s_[b] - displaced_ml_s,
                         injected_branch_ == static_cast<int>(b) ? &source_ : nullptr);
  }
}

void ContrastBolus::advect(double time_s) {
  const std::size_t root_start = junctions_.size() - 1;
  const auto start_of = [&](std::size_t b) {
    const int parent = tree_.branches()[b].parent;
    return parent < 0 ? root_start : static_cast<std::size_t>(parent);
  };
  std::fill(junctions_.begin(), junctions_.end(), Junction{});
  for (std::size_t b = 0; b < vessels_.size(); ++b) {
    const LaminarVessel& vessel = vessels_[b];
    Junction &start = junctions_[start_of(b)], &end = junctions_[b];
    start.entering_mg += vessel.leaving_start_mg(time_s);
    start.leaving_ml += std::max(0.0, vessel.start_ml_s()) * time_s;
    end.entering_mg += vessel.leaving_end_mg(time_s);
    end.leaving_ml += std::max(0.0, -vessel.end_ml_s()) * time_s;
  }
  washed_out_mg_ += junctions_[root_start].entering_mg;
  for (std::size_t b = 0; b < vessels_.size(); ++b) {
    if (tree_.branches()[b].children.empty()) washed_out_mg_ += junctions_[b].entering_mg;
    vessels_[b].advect(time_s, junctions_[start_of(b)].mg_ml(), junctions_[b].mg_ml());
  }
}

void ContrastBolus::step(double time_s, const VesselTree::Location& tip, double injection_ml_s,
                         double agent_mg_ml) {
  if (time_s <= 0) return;
  place_source(tip, injection_ml_s, agent_mg_ml);
  const double steps = std::ceil(time_s / longest_step_s());
  const double step_s = time_s / steps;
  for (double i = 0; i < steps; ++i) {
    set_flow(waveform_.at(time_s_ + (i + 0.5) * step_s));
    advect(step_s);
  }
  time_s_ += time_s;
  for (std::size_t b = 0; b < vessels_.size(); ++b) {
    vessels_[b].diffuse(time_s);
    washed_out_mg_ += vessels_[b].drop_traces_mg();
    vessels_[b].copy_means(iodine_mg_ml_[b]);
  }
}

double ContrastBolus::in_tree_mg() const {
  return std::accumulate(vessels_.begin(), vessels_.end(), 0.0,
                         [](double sum, const LaminarVessel& vessel) { return sum + vessel.in_vessel_mg(); });
}

}  // namespace xraycast
