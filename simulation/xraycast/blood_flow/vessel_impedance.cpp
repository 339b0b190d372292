#include "xraycast/blood_flow/vessel_impedance.hpp"

#include "xraycast/blood_flow/blood.hpp"
#include "xraycast/catheter/lumen_profile.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace xraycast {
namespace {

constexpr double kPa_per_mmHg = 133.322387415;
constexpr double kPi = std::numbers::pi;
// From Pa, kg, m and mm to mmHg and ml: a resistance in Pa s/mm3, an inertance in kg/m3 mm-1, a loss in kg/m3
// mm-4.
constexpr double kResistance = 1e3 / kPa_per_mmHg, kInertance = 1e-3 / kPa_per_mmHg, kLoss = 1 / kPa_per_mmHg;

/// The integral of dl / r^4 over a length of 1 with the radius linear from a to b.
double inverse_fourth(double a, double b) { return (a * a + a * b + b * b) / (3 * a * a * a * b * b * b); }

/// The conductance of an annulus relative to that of the whole pipe, by the ratio of its radii.
double annulus_share(double ratio) {
  if (ratio <= 0) return 1;
  const double squared = ratio * ratio;
  return 1 - squared * squared + (1 - squared) * (1 - squared) / std::log(ratio);
}

}  // namespace

std::vector<double> healthy_radii_mm(const VesselBranch& branch) {
  const std::size_t count = branch.points.size();
  std::vector<double> before(count), behind(count);
  double widest = 0;
  for (std::size_t i = 0; i < count; ++i) before[i] = widest = std::max(widest, branch.points[i].radius_mm);
  widest = 0;
  for (std::size_t i = count; i-- > 0;) behind[i] = widest = std::max(widest, branch.points[i].radius_mm);
  for (std::size_t i = 0; i < count; ++i) before[i] = std::min(before[i], behind[i]);
  return before;
}

VesselImpedance::VesselImpedance(const VesselBranch& branch, const std::vector<double>& radii_mm)
    : arc_mm_(branch.arc_length_mm),
      radius_mm_(radii_mm),
      occupied_(branch.points.size() - 1),
      up_to_(branch.points.size()) {
  if (radii_mm.empty())
    for (const VesselPoint& point : branch.points) radius_mm_.push_back(point.radius_mm);
  find_stenoses();
  add_up();
}

/// Runs of points that are narrower than the branch would be without them.
void VesselImpedance::find_stenoses() {
  VesselBranch shape;
  for (const double radius_mm : radius_mm_) shape.points.push_back({{0, 0, 0}, radius_mm});
  const std::vector<double> healthy_mm = healthy_radii_mm(shape);
  const std::size_t count = radius_mm_.size();
  for (std::size_t i = 0; i < count;) {
    if (radius_mm_[i] >= healthy_mm[i]) {
      ++i;
      continue;
    }
    const std::size_t begin = i;
    std::size_t throat = i;
    for (; i < count && radius_mm_[i] < healthy_mm[i]; ++i)
      if (radius_mm_[i] < radius_mm_[throat]) throat = i;
    // From the last point of the healthy vessel to the next one: a run is never at an end of the branch.
    double length_mm = 0;
    const double narrow_mm = radius_mm_[throat];
    for (std::size_t s = begin - 1; s < i; ++s)
      length_mm += (arc_mm_[s + 1] - arc_mm_[s]) * inverse_fourth(radius_mm_[s], radius_mm_[s + 1]);
    length_mm *= narrow_mm * narrow_mm * narrow_mm * narrow_mm;
    const double area = kPi * narrow_mm * narrow_mm, wide = kPi * healthy_mm[throat] * healthy_mm[throat];
    constexpr double kTurbulent = 1.52, kOfLength = 0.83, kOfWidth = 1.64;
    const double jet = 1 / area - 1 / wide;
    const double developed = std::clamp(4 * (1 - area / wide) - 1, 0.0, 1.0);
    const double added_mm = developed * ((kOfLength - 1) * length_mm + kOfWidth * 2 * narrow_mm);
    throats_.push_back({throat, developed * kLoss * kTurbulent * 0.5 * kBloodDensity_kg_m3 * jet * jet,
                        kResistance * 8 * kBloodViscosity_Pa_s / kPi * added_mm /
                            (narrow_mm * narrow_mm * narrow_mm * narrow_mm)});
  }
}

void VesselImpedance::add_up() {
  FlowLoss sum;
  std::size_t next = 0;
  up_to_[0] = sum;
  for (std::size_t s = 0; s + 1 < radius_mm_.size(); ++s) {
    const double length_mm = arc_mm_[s + 1] - arc_mm_[s], a = radius_mm_[s], b = radius_mm_[s + 1];
    const double ratio = std::min(occupied_[s].radius_mm / std::sqrt(a * b), kFillsLumen),
                 share = occupied_[s].share;
    if (ratio == kFillsLumen) ++sum.blocked;
    sum.resistance += kResistance * 8 * kBloodViscosity_Pa_s / kPi * length_mm * inverse_fourth(a, b) *
                      (1 - share + share / annulus_share(ratio));
    sum.inertance += kInertance * kBloodDensity_kg_m3 / kPi * length_mm / (a * b) *
                     (1 - share + share / (1 - ratio * ratio));
    if (next < throats_.size() && throats_[next].point == s + 1) {
      sum.quadratic_loss += throats_[next].quadratic_loss;
      sum.resistance += throats_[next++].added_resistance;
    }
    up_to_[s + 1] = sum;
  }
}

FlowLoss VesselImpedance::up_to(double arc_length_mm) const {
  const auto above = std::upper_bound(arc_mm_.begin(), arc_mm_.end(), arc_length_mm) - arc_mm_.begin();
  const auto last = static_cast<std::ptrdiff_t>(arc_mm_.size()) - 1;
  const auto s = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(above, 1, last)) - 1;
  const double share = std::clamp((arc_length_mm - arc_mm_[s]) / (arc_mm_[s + 1] - arc_mm_[s]), 0.0, 1.0);
  const FlowLoss &a = up_to_[s], &b = up_to_[s + 1];
  return {std::lerp(a.resistance, b.resistance, share), std::lerp(a.inertance, b.inertance, share),
          std::lerp(a.quadratic_loss, b.quadratic_loss, share), b.blocked};
}

void VesselImpedance::occupy(double from_mm, double to_mm, double radius_mm) {
  for (std::size_t s = 0; s < occupied_.size(); ++s) {
    const double begin_mm = std::max(from_mm, arc_mm_[s]), end_mm = std::min(to_mm, arc_mm_[s + 1]);
    const Occupied here{radius_mm, (end_mm - begin_mm) / (arc_mm_[s + 1] - arc_mm_[s])};
    const Occupied& before = occupied_[s];
    if (here.share > 0 && std::pair(here.radius_mm, here.share) > std::pair(before.radius_mm, before.share))
      occupied_[s] = here;
  }
  add_up();
}

void VesselImpedance::empty() {
  std::fill(occupied_.begin(), occupied_.end(), Occupied{});
  add_up();
}

}  // namespace xraycast
