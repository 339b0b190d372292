#include "xraycast/simulation/contrast_bolus.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

constexpr double kMl_per_mm3 = 1e-3;

double area_mm2(double radius_mm) { return std::numbers::pi * radius_mm * radius_mm; }

/// A frustum.
double volume_ml(const VesselBranch& branch, std::size_t segment) {
  const double a = branch.points[segment].radius_mm, b = branch.points[segment + 1].radius_mm;
  const double length_mm = branch.arc_length_mm[segment + 1] - branch.arc_length_mm[segment];
  return kMl_per_mm3 * std::numbers::pi / 3 * length_mm * (a * a + a * b + b * b);
}

std::vector<int> parents_first(const VesselTree& tree) {
  std::vector<int> order{tree.root()};
  for (std::size_t i = 0; i < order.size(); ++i)
    for (const int child : tree.branches()[static_cast<std::size_t>(order[i])].children)
      order.push_back(child);
  return order;
}

/// Divides a flow among a branch's children by their cross-sections: calls `child_gets(child, flow)`.
template <typename ChildGets>
void divide(const VesselTree& tree, int branch, double flow_ml_s, const ChildGets& child_gets) {
  const auto& branches = tree.branches();
  const std::vector<int>& children = branches[static_cast<std::size_t>(branch)].children;
  // A child starts at its parent's end; a little further on it has its own width.
  const auto section = [&](int child) {
    const auto& points = branches[static_cast<std::size_t>(child)].points;
    return area_mm2(points[points.size() / 2].radius_mm);
  };
  double all_mm2 = 0;
  for (const int child : children) all_mm2 += section(child);
  for (const int child : children) child_gets(child, flow_ml_s * section(child) / all_mm2);
}

}  // namespace

ContrastBolus::ContrastBolus(const VesselTree& tree, const Blood& blood)
    : tree_(tree), order_(parents_first(tree)), blood_ml_s_(tree.branches().size()) {
  for (const VesselBranch& branch : tree.branches()) {
    const std::size_t segments = branch.points.size() - 1;
    std::vector<double>& volumes = volumes_ml_.emplace_back(segments);
    for (std::size_t i = 0; i < segments; ++i) volumes[i] = volume_ml(branch, i);
    flow_ml_s_.emplace_back(segments);
    iodine_mg_ml_.emplace_back(segments);
  }
  const VesselBranch& root = tree.branches()[static_cast<std::size_t>(tree.root())];
  blood_ml_s_[static_cast<std::size_t>(tree.root())] =
      kMl_per_mm3 * area_mm2(root.points.front().radius_mm) * blood.root_velocity_mm_s;
  for (const int branch : order_)
    divide(tree, branch, blood_ml_s_[static_cast<std::size_t>(branch)],
           [&](int child, double flow) { blood_ml_s_[static_cast<std::size_t>(child)] = flow; });
}

void ContrastBolus::set_flow(const VesselTree::Location& tip, double injection_ml_s) {
  injected_branch_ = tip.branch;
  const VesselBranch& injected = tree_.branches()[static_cast<std::size_t>(tip.branch)];
  const auto after = std::ranges::upper_bound(injected.arc_length_mm, tip.arc_length_mm);
  const auto point = std::max<std::ptrdiff_t>(1, after - injected.arc_length_mm.begin());
  injected_segment_ = std::min(static_cast<std::size_t>(point), injected.points.size() - 1) - 1;

  std::vector<double> added_ml_s(order_.size());
  for (const int branch : order_) {
    const auto b = static_cast<std::size_t>(branch);
    const double before = blood_ml_s_[b] + added_ml_s[b];
    if (branch == injected_branch_) added_ml_s[b] = injection_ml_s;  // nothing was added upstream
    std::ranges::fill(flow_ml_s_[b], blood_ml_s_[b] + added_ml_s[b]);
    if (branch == injected_branch_) std::fill_n(flow_ml_s_[b].begin(), injected_segment_, before);
    divide(tree_, branch, added_ml_s[b],
           [&](int child, double flow) { added_ml_s[static_cast<std::size_t>(child)] = flow; });
  }
}

/// One implicit step, from the root to the leaves: what enters a segment is known when it is visited.
void ContrastBolus::advect(double time_s) {
  std::vector<double> entering_mg(order_.size());
  for (const int branch : order_) {
    const auto b = static_cast<std::size_t>(branch);
    std::vector<double>& iodine = iodine_mg_ml_[b];
    double leaving_mg = entering_mg[b];
    for (std::size_t i = 0; i < iodine.size(); ++i) {
      if (branch == injected_branch_ && i == injected_segment_) leaving_mg += injected_mg_s_ * time_s;
      const double volume_ml = volumes_ml_[b][i], leaving_ml = flow_ml_s_[b][i] * time_s;
      iodine[i] = (iodine[i] * volume_ml + leaving_mg) / (volume_ml + leaving_ml);
      leaving_mg = iodine[i] * leaving_ml;
    }
    if (tree_.branches()[b].children.empty()) washed_out_mg_ += leaving_mg;
    divide(tree_, branch, leaving_mg,
           [&](int child, double mg) { entering_mg[static_cast<std::size_t>(child)] = mg; });
  }
}

void ContrastBolus::step(double time_s, const VesselTree::Location& tip, double injection_ml_s,
                         double agent_mg_ml) {
  set_flow(tip, injection_ml_s);
  injected_mg_s_ = injection_ml_s * agent_mg_ml;
  constexpr double kMaxStep_s = 0.01;  // the blood moves by at most a vessel's width
  const double steps = std::ceil(time_s / kMaxStep_s);
  for (int i = 0; i < static_cast<int>(steps); ++i) advect(time_s / steps);
}

}  // namespace xraycast
