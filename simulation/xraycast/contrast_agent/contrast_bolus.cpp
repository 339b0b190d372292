#include "xraycast/contrast_agent/contrast_bolus.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace xraycast {
namespace {

constexpr double kShortestStep_s = 5e-4, kMl_of_mm3 = 1e-3;
/// How far from a tip its jet mixes agent and blood, in radii of the vessel: then none is sharp at a tip.
constexpr double kJetRadii = 1.5;

/// A child starts at its parent's end; a little further on it has its own width.
double width_mm(const VesselBranch& branch) { return branch.points[branch.points.size() / 2].radius_mm; }

/// The radius over the thickness of the boundary layer that oscillates with the heart.
double womersley_number(double radius_mm, double heart_rate_bpm) {
  constexpr double kViscosity_mm2_s = 1e6 * kBloodViscosity_Pa_s / kBloodDensity_kg_m3;
  return radius_mm * std::sqrt(2 * std::numbers::pi * heart_rate_bpm / 60 / kViscosity_mm2_s);
}

double profile_exponent(const VesselBranch& branch, const Blood& blood) {
  constexpr double kParabola = 2, kBluntest = 9;
  if (blood.profile_exponent > 0) return blood.profile_exponent;
  const double bpm = blood.heart ? 60 / blood.heart->period_s() : blood.heart_rate_bpm;
  return std::clamp(womersley_number(width_mm(branch), bpm), kParabola, kBluntest);
}

}  // namespace

ContrastBolus::ContrastBolus(const VesselTree& tree, const Blood& blood)
    : tree_(tree), flow_(tree, blood), junctions_(tree.branches().size() + 1) {
  for (std::size_t b = 0; b < tree.branches().size(); ++b) {
    const VesselBranch& branch = tree.branches()[b];
    const double n = profile_exponent(branch, blood);
    const double fastest_ml_s = (n + 2) / n * flow_.peak_ml_s(b);
    vessels_.emplace_back(branch, n, blood.diffusivity_mm2_s, kShortestStep_s * fastest_ml_s);
    iodine_mg_ml_.emplace_back(branch.points.size() - 1);
  }
  for (const AneurysmSac& sac : flow_.sacs()) sacs_.emplace_back(kMl_of_mm3 * sac.volume_mm3());
}

/// As it has been in the flow's last step.
void ContrastBolus::set_flow(const VesselTree::Location& tip, double ml_s, double mg_ml) {
  const auto injected = static_cast<std::size_t>(tip.branch);
  // Nothing can be injected where both ends are closed.
  const double gained_ml_s = flow_.end_ml_s(injected) - flow_.start_ml_s(injected);
  const bool injects = ml_s > 0 && gained_ml_s > 0.5 * ml_s;
  if (injects) source_ = {tip.arc_length_mm, kJetRadii * width_mm(tree_.branches()[injected]), ml_s, mg_ml};
  for (std::size_t b = 0; b < vessels_.size(); ++b)
    vessels_[b].set_flow(flow_.end_ml_s(b), injects && b == injected && !sac_at(b) ? &source_ : nullptr);
  for (std::size_t s = 0; s < sacs_.size(); ++s) {
    const bool takes = injects && flow_.sacs()[s].branch == tip.branch;
    sacs_[s].set_flow(flow_.sac_ml_s(s), takes ? ml_s : 0, mg_ml);
  }
}

const MixedSac* ContrastBolus::sac_at(std::size_t branch) const {
  for (std::size_t s = 0; s < sacs_.size(); ++s)
    if (static_cast<std::size_t>(flow_.sacs()[s].branch) == branch) return &sacs_[s];
  return nullptr;
}

void ContrastBolus::pack(std::size_t sac, const CoilBed& bed) {
  flow_.pack(sac, bed);
  sacs_[sac].set_volume_ml(kMl_of_mm3 * (1 - bed.packing) * flow_.sacs()[sac].volume_mm3());
}

double ContrastBolus::longest_step_s() const {
  double longest_s = std::numeric_limits<double>::infinity();
  for (const LaminarVessel& vessel : vessels_) {
    const double flow_ml_s = std::max(std::abs(vessel.start_ml_s()), std::abs(vessel.end_ml_s()));
    if (flow_ml_s > 0) longest_s = std::min(longest_s, vessel.longest_step_s(flow_ml_s));
  }
  return longest_s;
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
    end.leaving_ml +=
        (flow_.is_outlet(b) ? std::abs(vessel.end_ml_s()) : std::max(0.0, -vessel.end_ml_s())) * time_s;
  }
  for (std::size_t s = 0; s < sacs_.size(); ++s) {
    Junction& junction = junctions_[start_of(static_cast<std::size_t>(flow_.sacs()[s].branch))];
    const double leaving_mg = sacs_[s].leaving_mg(time_s);
    junction.entering_mg -= sacs_[s].advance(time_s, junction.mg_ml());
    junction.entering_mg += leaving_mg;
  }
  washed_out_mg_ += junctions_[root_start].entering_mg;
  for (std::size_t b = 0; b < vessels_.size(); ++b) {
    // Blood that comes in at an outlet takes along what has left a sac there.
    if (flow_.is_outlet(b) && vessels_[b].end_ml_s() >= 0) washed_out_mg_ += junctions_[b].entering_mg;
    vessels_[b].advect(time_s, junctions_[start_of(b)].mg_ml(), junctions_[b].mg_ml());
  }
}

void ContrastBolus::step(double time_s, const VesselTree::Location& tip, double injection_ml_s,
                         double agent_mg_ml, const Particles& particles) {
  if (time_s <= 0) return;
  const double steps = std::ceil(time_s / TreeFlow::kLongestStep_s), step_s = time_s / steps;
  for (double i = 0; i < steps; ++i) {
    flow_.step(step_s, tip, injection_ml_s, particles);
    set_flow(tip, injection_ml_s, agent_mg_ml);
    const double parts = std::ceil(step_s / longest_step_s());
    for (double part = 0; part < parts; ++part) advect(step_s / parts);
  }
  for (std::size_t b = 0; b < vessels_.size(); ++b) {
    vessels_[b].diffuse(time_s);
    washed_out_mg_ += vessels_[b].drop_traces_mg();
  }
  copy_means();
}

void ContrastBolus::copy_means() {
  for (std::size_t b = 0; b < vessels_.size(); ++b) {
    vessels_[b].copy_means(iodine_mg_ml_[b]);
    if (const MixedSac* sac = sac_at(b))
      std::fill(iodine_mg_ml_[b].begin(), iodine_mg_ml_[b].end(), sac->mg_ml());
  }
}

void ContrastBolus::take_radii(const VesselTree& tree) {
  flow_.set_lumens(tree);
  for (std::size_t b = 0; b < vessels_.size(); ++b) vessels_[b].take_radii(tree.branches()[b]);
  copy_means();
}

double ContrastBolus::in_tree_mg() const {
  double sum_mg = 0;
  for (const LaminarVessel& vessel : vessels_) sum_mg += vessel.in_vessel_mg();
  for (const MixedSac& sac : sacs_) sum_mg += sac.in_sac_mg();
  return sum_mg;
}

}  // namespace xraycast
