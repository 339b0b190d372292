#include "xraycast/contrast_agent/laminar_vessel.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace xraycast {
namespace {

constexpr double kMl_per_mm3 = 1e-3;

/// The lumen's volume from a branch's first point on, in frustums.
class LumenVolume {
 public:
  explicit LumenVolume(const VesselBranch& branch) : branch_(branch), to_mm3_{0} {
    for (std::size_t i = 0; i + 1 < branch.points.size(); ++i)
      to_mm3_.push_back(to_mm3_.back() + frustum_mm3(i, branch.arc_length_mm[i + 1]));
  }

  double up_to_mm3(double arc_length_mm) const {
    const auto& ends_mm = branch_.arc_length_mm;
    const auto above = std::upper_bound(ends_mm.begin(), ends_mm.end(), arc_length_mm) - ends_mm.begin();
    const auto segment =
        static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(above, 1, std::ssize(ends_mm) - 1)) - 1;
    return to_mm3_[segment] + frustum_mm3(segment, arc_length_mm);
  }

 private:
  double frustum_mm3(std::size_t segment, double to_mm) const {
    const double from_mm = branch_.arc_length_mm[segment];
    const double a = branch_.points[segment].radius_mm, end = branch_.points[segment + 1].radius_mm;
    const double b = std::lerp(a, end, (to_mm - from_mm) / (branch_.arc_length_mm[segment + 1] - from_mm));
    return std::numbers::pi / 3 * (to_mm - from_mm) * (a * a + a * b + b * b);
  }

  const VesselBranch& branch_;
  std::vector<double> to_mm3_;
};

/// Slopes that make no new extremes: the central difference, within twice those to either side.
double monotonised(double before, double after) {
  const double central = 0.5 * (before + after);
  const double up = std::min(std::min(2 * before, 2 * after), central);
  const double down = std::max(std::max(2 * before, 2 * after), central);
  return std::max(up, 0.0) + std::min(down, 0.0);
}

}  // namespace

LaminarVessel::LaminarVessel(const VesselBranch& branch, double profile_exponent, double diffusivity_mm2_s,
                             double least_ml)
    : length_mm_(branch.arc_length_mm.back()),
      ends_mm_(branch.arc_length_mm.begin() + 1, branch.arc_length_mm.end()),
      diffusivity_mm2_s_(diffusivity_mm2_s),
      fewest_ml_(least_ml) {
  constexpr double kCell_mm = 2, kMostCells = 4096;
  const auto cells = static_cast<std::size_t>(std::clamp(std::round(length_mm_ / kCell_mm), 1.0, kMostCells));
  measure(branch, cells);
  mg_ml_.resize(cells);
  crossing_mg_ml_.resize(cells + 1);

  // The mean of the profile over each ring, whose area is s = (r/R)^2.
  const double n = profile_exponent;
  const auto flow_within = [n](double s) { return (n + 2) / n * (s - std::pow(s, n / 2 + 1) / (n / 2 + 1)); };
  for (std::size_t k = 0; k < kLaminae; ++k) {
    const auto inner = static_cast<double>(k), count = static_cast<double>(kLaminae);
    velocity_[k] = count * (flow_within((inner + 1) / count) - flow_within(inner / count));
  }
}

void LaminarVessel::measure(const VesselBranch& branch, std::size_t cells) {
  const double cell_mm = length_mm_ / static_cast<double>(cells);
  const LumenVolume lumen(branch);
  volume_ml_.clear();
  exchange_per_s_.clear();
  for (std::size_t i = 0; i < cells; ++i) {
    const double mm3 = lumen.up_to_mm3(cell_mm * static_cast<double>(i + 1)) -
                       lumen.up_to_mm3(cell_mm * static_cast<double>(i));
    volume_ml_.push_back(std::max(kMl_per_mm3 * mm3, fewest_ml_));
    const double radius2_mm2 = mm3 / (std::numbers::pi * cell_mm);
    exchange_per_s_.push_back(4 * diffusivity_mm2_s_ / radius2_mm2);
  }
  least_ml_ = *std::min_element(volume_ml_.begin(), volume_ml_.end());
}

void LaminarVessel::take_radii(const VesselBranch& branch) {
  const std::vector<double> before_ml = volume_ml_;
  measure(branch, before_ml.size());
  for (std::size_t i = 0; i < before_ml.size(); ++i)
    for (double& mg_ml : mg_ml_[i]) mg_ml *= before_ml[i] / volume_ml_[i];
}

std::size_t LaminarVessel::cell_at(double arc_length_mm) const {
  const auto cells = static_cast<double>(mg_ml_.size());
  return static_cast<std::size_t>(std::clamp(std::floor(arc_length_mm / length_mm_ * cells), 0.0, cells - 1));
}

void LaminarVessel::set_flow(double end_ml_s, const Source* source) {
  source_ = source ? *source : Source{};
  end_ml_s_ = end_ml_s;
  start_ml_s_ = end_ml_s - source_.ml_s;
  share_source();
}

/// A triangle about the source's place, cut off at the vessel's ends.
void LaminarVessel::share_source() {
  shares_.clear();
  if (!(source_.ml_s > 0)) return;
  const std::size_t cells = mg_ml_.size();
  const double cell_mm = length_mm_ / static_cast<double>(cells);
  const double at_mm = cell_mm * (static_cast<double>(cell_at(source_.at_mm)) + 0.5);
  const double reach_mm = std::max(source_.reach_mm, cell_mm);
  double sum = 0;
  shares_.push_back(0);
  for (std::size_t i = 0; i < cells; ++i) {
    const double away_mm = std::abs(cell_mm * (static_cast<double>(i) + 0.5) - at_mm);
    shares_.push_back(sum += std::max(0.0, 1 - away_mm / reach_mm));
  }
  for (double& share : shares_) share /= sum;
}

double LaminarVessel::longest_step_s(double flow_ml_s) const {
  constexpr double kCourant = 0.95;
  return kCourant * least_ml_ / (velocity_.front() * flow_ml_s);
}

/// The agent in `ml` that flow out of a cell at the vessel's end.
double LaminarVessel::leaving_mg(std::size_t cell, double ml) const {
  double sum = 0;
  for (std::size_t k = 0; k < kLaminae; ++k) sum += velocity_[k] * mg_ml_[cell][k];
  return ml * sum / static_cast<double>(kLaminae);
}

double LaminarVessel::leaving_start_mg(double time_s) const {
  return is_empty_ ? 0 : leaving_mg(0, std::max(0.0, -start_ml_s_) * time_s);
}

double LaminarVessel::leaving_end_mg(double time_s) const {
  return is_empty_ ? 0 : leaving_mg(mg_ml_.size() - 1, std::max(0.0, end_ml_s_) * time_s);
}

/// From the middle of a cell to its end.
LaminarVessel::Laminae LaminarVessel::slope(std::size_t cell) const {
  Laminae slope{};
  if (cell == 0 || cell + 1 == mg_ml_.size()) return slope;
  const Laminae &before = mg_ml_[cell - 1], &here = mg_ml_[cell], &after = mg_ml_[cell + 1];
  for (std::size_t k = 0; k < kLaminae; ++k)
    slope[k] = 0.5 * monotonised(here[k] - before[k], after[k] - here[k]);
  return slope;
}

/// What crosses an inner face in a step: the mean of the upstream cell's line over what passes.
LaminarVessel::Laminae LaminarVessel::at_face(std::size_t face, double time_s) const {
  const double ml = flow_ml_s(face) * time_s;
  const std::size_t cell = ml >= 0 ? face - 1 : face;
  const double passed = ml / volume_ml_[cell];
  const Laminae& here = mg_ml_[cell];
  Laminae crossing = slope(cell);
  for (std::size_t k = 0; k < kLaminae; ++k)
    crossing[k] = here[k] + (std::copysign(1.0, ml) - velocity_[k] * passed) * crossing[k];
  return crossing;
}

void LaminarVessel::advect(double time_s, double start_mg_ml, double end_mg_ml) {
  const bool injects = !shares_.empty();
  if (is_empty_ && start_mg_ml == 0 && end_mg_ml == 0 && !injects) return;
  is_empty_ = false;
  const std::size_t cells = mg_ml_.size();
  if (start_ml_s_ >= 0)
    crossing_mg_ml_.front().fill(start_mg_ml);
  else
    crossing_mg_ml_.front() = mg_ml_.front();
  if (end_ml_s_ < 0)
    crossing_mg_ml_.back().fill(end_mg_ml);
  else
    crossing_mg_ml_.back() = mg_ml_.back();
  for (std::size_t face = 1; face < cells; ++face) crossing_mg_ml_[face] = at_face(face, time_s);
  for (std::size_t i = 0; i < cells; ++i) {
    const double share = time_s / volume_ml_[i];
    const double in = flow_ml_s(i) * share, out = flow_ml_s(i + 1) * share;
    const double injected =
        injects ? (shares_[i + 1] - shares_[i]) * source_.ml_s * source_.mg_ml * share : 0;
    const Laminae &before = crossing_mg_ml_[i], &after = crossing_mg_ml_[i + 1];
    for (std::size_t k = 0; k < kLaminae; ++k)
      mg_ml_[i][k] += velocity_[k] * (in * before[k] - out * after[k] + injected);
  }
}

/// One implicit step of dc/dt = 4 D / R^2 d/ds (s dc/ds), s being the share of the cross-section within a
/// radius: a tridiagonal system for each cell, solved from the axis outwards and back.
void LaminarVessel::diffuse(double time_s) {
  if (is_empty_) return;
  constexpr auto kCount = static_cast<double>(kLaminae);
  for (std::size_t i = 0; i < mg_ml_.size(); ++i) {
    const double rate = exchange_per_s_[i] * time_s * kCount;  // over the face at s = 1, between two laminae
    Laminae& c = mg_ml_[i];
    Laminae upper{};
    double inner = 0;  // the exchange over the lamina's inner face
    for (std::size_t k = 0; k < kLaminae; ++k) {
      const double outer = k + 1 < kLaminae ? rate * static_cast<double>(k + 1) : 0;
      const double pivot = 1 + inner + outer - (k > 0 ? inner * upper[k - 1] : 0);
      upper[k] = outer / pivot;
      c[k] = (c[k] + (k > 0 ? inner * c[k - 1] : 0)) / pivot;
      inner = outer;
    }
    for (std::size_t k = kLaminae - 1; k-- > 0;) c[k] += upper[k] * c[k + 1];
  }
}

double LaminarVessel::drop_traces_mg() {
  if (is_empty_) return 0;
  constexpr double kTrace_mg_ml = 1e-9;
  double dropped_mg = 0;
  is_empty_ = true;
  for (std::size_t i = 0; i < mg_ml_.size(); ++i) {
    if (*std::max_element(mg_ml_[i].begin(), mg_ml_[i].end()) > kTrace_mg_ml) {
      is_empty_ = false;
      continue;
    }
    for (const double c : mg_ml_[i]) dropped_mg += volume_ml_[i] * c / static_cast<double>(kLaminae);
    mg_ml_[i].fill(0);
  }
  return dropped_mg;
}

double LaminarVessel::in_vessel_mg() const {
  double sum_mg = 0;
  for (std::size_t i = 0; i < mg_ml_.size(); ++i)
    for (const double c : mg_ml_[i]) sum_mg += volume_ml_[i] * c / static_cast<double>(kLaminae);
  return sum_mg;
}

void LaminarVessel::copy_means(std::vector<double>& mg_ml) const {
  mg_ml.assign(ends_mm_.size(), 0);
  if (is_empty_) return;
  const double cell_mm = length_mm_ / static_cast<double>(mg_ml_.size());
  double from_mm = 0;
  for (std::size_t segment = 0; segment < ends_mm_.size(); ++segment) {
    const double to_mm = ends_mm_[segment];
    for (std::size_t i = cell_at(from_mm); i < mg_ml_.size(); ++i) {
      const double start_mm = cell_mm * static_cast<double>(i);
      if (start_mm >= to_mm) break;
      const double shared_mm = std::min(to_mm, start_mm + cell_mm) - std::max(from_mm, start_mm);
      double mean = 0;
      for (const double c : mg_ml_[i]) mean += c / static_cast<double>(kLaminae);
      mg_ml[segment] += std::max(0.0, shared_mm) / (to_mm - from_mm) * mean;
    }
    from_mm = to_mm;
  }
}

}  // namespace xraycast
