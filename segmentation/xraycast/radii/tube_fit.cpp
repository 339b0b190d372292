#include "xraycast/radii/tube_fit.hpp"

#include "xraycast/radii/tube_profile.hpp"

#include <glm/geometric.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <numeric>
#include <utility>
#include <vector>

namespace xraycast {
namespace {

/// Parameters in the order of their equations; those of slopes are left out where they are fixed.
constexpr auto kDirections = static_cast<Eigen::Index>(Tube::kDirections);
enum : Eigen::Index {
  kRadius,
  kTaper,
  kLumen,
  kOffX,
  kOffY,
  kAround,
  kSlope = kAround + kDirections,
  kMost = kSlope + kDirections
};
using Parameters = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMost, 1>;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMost, kMost>;

/// One below two and a half deviations, none above five.
double robust_weight(double deviations) {
  constexpr double kAll = 2.5, kNone = 5;
  const double beyond = std::clamp((std::abs(deviations) - kAll) / (kNone - kAll), 0.0, 1.0);
  const double left = 1 - beyond * beyond;
  return left * left;
}

/// Between which two directions a sample lies, the first one before the second in their order.
struct Direction {
  Eigen::Index first, second;
  double fraction;  ///< of the way from the first to the second
};

Direction direction_of(const glm::dvec2& at_mm) {
  const double turns = std::atan2(at_mm.y, at_mm.x) / (2 * std::numbers::pi) + 1,
               place = turns * static_cast<double>(kDirections), below = std::floor(place);
  const auto first = static_cast<Eigen::Index>(below) % kDirections;
  if (first + 1 == kDirections) return {0, first, 1 - (place - below)};
  return {first, first + 1, place - below};
}

/// Normal equations about some parameters, and what the residuals are there.
struct Equations {
  explicit Equations(Eigen::Index count)
      : normal(Matrix::Zero(count, count)), gradient(Parameters::Zero(count)) {}

  Matrix normal;
  Parameters gradient;
  double cost = 0;  ///< of residuals in deviations and of what is known, each squared
  double squares_hu2 = 0, all_squares_hu2 = 0, weight = 0, weight_in = 0;
};

class TubeFit {
 public:
  TubeFit(std::span<const SampleAcross> samples, const TubeQuestion& question)
      : samples_(samples),
        question_(question),
        has_slopes_(!question.is_even && !question.slope.is_fixed()),
        count_(has_slopes_ ? kMost : kSlope),
        known_{question.radius, question.taper, question.lumen, question.off_x, question.off_y} {
    // Even surroundings are those of the first direction.
    std::fill_n(known_.begin() + kAround, kDirections, question.is_even ? Known{0, 0} : question.around);
    known_[kAround] = question.around;
    std::fill_n(known_.begin() + kSlope, kDirections, question.slope);
    for (const SampleAcross& sample : samples)
      directions_.push_back(question.is_even ? Direction{0, 0, 0} : direction_of(sample.at_mm));
  }

  std::optional<TubeAnswer> answer() {
    constexpr int kSteps = 25;
    Parameters now = parameters_of(question_.start);
    for (Eigen::Index k = 0; k < count_; ++k)
      if (known(k).is_fixed()) now[k] = known(k).mean;
    double damping = 1e-3;
    Equations here = equations(now);
    for (int step = 0; step < kSteps; ++step) {
      Matrix damped = here.normal;
      damped.diagonal() += damping * here.normal.diagonal();
      const Parameters change = damped.ldlt().solve(here.gradient);
      if (!change.allFinite()) break;
      const Parameters next = within_bounds(now + change);
      const Equations there = equations(next);
      // Weights change with the residuals, so that a cost that hardly rises is taken too.
      constexpr double kHardly = 1 + 1e-9, kSettled = 1e-4;
      if (std::isfinite(there.cost) && there.cost <= kHardly * here.cost) {
        const bool is_settled = std::abs(next[kRadius] - now[kRadius]) < kSettled * question_.blur_mm;
        now = next;
        here = there;
        damping = std::max(0.2 * damping, 1e-6);
        if (is_settled && step > 1) break;
      } else if (damping *= 8; damping > 1e6) {
        break;
      }
    }
    return answer_of(now, here);
  }

 private:
  const Known& known(Eigen::Index k) const { return known_[static_cast<std::size_t>(k)]; }

  Parameters parameters_of(const Tube& tube) const {
    Parameters p(count_);
    p.head<kAround>() << tube.radius_mm, tube.taper, tube.lumen_hu, tube.off_mm.x, tube.off_mm.y;
    std::ranges::copy(tube.around_hu, p.data() + kAround);
    if (has_slopes_) std::ranges::copy(tube.slope_hu_per_mm, p.data() + kSlope);
    return p;
  }

  Tube tube_of(const Parameters& p) const {
    Tube tube{p[kRadius], p[kTaper], p[kLumen], {p[kOffX], p[kOffY]}, {}, {}};
    std::copy_n(p.data() + kAround, kDirections, tube.around_hu.begin());
    if (has_slopes_) std::copy_n(p.data() + kSlope, kDirections, tube.slope_hu_per_mm.begin());
    if (question_.is_even) tube.around_hu.fill(p[kAround]);
    return tube;
  }

  Parameters within_bounds(Parameters p) const {
    constexpr double kThinnest = 0.1, kWider = 10;  // blurs
    p[kRadius] = std::clamp(p[kRadius], kThinnest * question_.blur_mm,
                            2 * question_.start.radius_mm + kWider * question_.blur_mm);
    return p;
  }

  struct Expected {
    double hu, by_value;  ///< its derivative
  };

  Expected expected(double value_hu) const {
    if (question_.response == nullptr) return {value_hu, 1};
    const double step_hu = 0.05 * question_.noise_hu, hu = question_.response->mean_hu(value_hu);
    return {hu, (question_.response->mean_hu(value_hu + step_hu) - hu) / step_hu};
  }

  Equations equations(const Parameters& p) const {
    const TubeProfile profile(p[kRadius], question_.blur_mm);
    Equations sum(count_);
    for (std::size_t i = 0; i < samples_.size(); ++i)
      add_sample(p, profile, samples_[i], directions_[i], sum);
    sum.normal.triangularView<Eigen::StrictlyLower>() = sum.normal.transpose();
    add_known(p, sum);
    return sum;
  }

  void add_sample(const Parameters& p, const TubeProfile& profile, const SampleAcross& sample,
                  const Direction& direction, Equations& sum) const {
    const glm::dvec2 from = sample.at_mm - glm::dvec2(p[kOffX], p[kOffY]);
    const double distance = glm::length(from),
                 // A wall that is farther out is that of the middle seen from nearer to the axis.
        moved = std::max(distance - p[kTaper] * sample.along_mm, 0.0);
    const TubeProfile::Value at = profile.at(moved);
    const Eigen::Index first = kAround + direction.first, second = kAround + direction.second,
                       first_slope = kSlope + direction.first, second_slope = kSlope + direction.second;
    const double beyond_mm = std::max(moved - p[kRadius], 0.0),
                 slope = has_slopes_ ? std::lerp(p[first_slope], p[second_slope], direction.fraction) : 0,
                 around_hu = std::lerp(p[first], p[second], direction.fraction) + beyond_mm * slope,
                 contrast_hu = p[kLumen] - around_hu;
    const auto [hu, by_value] = expected(around_hu + contrast_hu * at.share);
    const double residual = (sample.hu - hu) / question_.noise_hu, robust = robust_weight(residual),
                 weight = sample.weight * robust;
    sum.weight += sample.weight;
    sum.weight_in += weight;
    // What is left out costs about what its last deviation did.
    constexpr double kOut = 14;
    const double cost = sample.weight * (robust * residual * residual + (1 - robust) * kOut);
    sum.cost += cost;
    const double noise2_hu2 = question_.noise_hu * question_.noise_hu;
    sum.squares_hu2 += weight * residual * residual * noise2_hu2;
    sum.all_squares_hu2 += cost * noise2_hu2;

    const double scale = by_value / question_.noise_hu, outside = 1 - at.share,
                 around_by_distance = beyond_mm > 0 ? outside * slope : 0,
                 by_distance = contrast_hu * at.by_distance + around_by_distance,
                 outwards = -by_distance / std::max(distance, 1e-6);
    const std::array<std::pair<Eigen::Index, double>, 9> row{{
        {kRadius, scale * (contrast_hu * at.by_radius - around_by_distance)},
        {kTaper, -scale * by_distance * sample.along_mm},
        {kLumen, scale * at.share},
        {kOffX, scale * outwards * from.x},
        {kOffY, scale * outwards * from.y},
        {first, scale * outside * (1 - direction.fraction)},
        {second, scale * outside * direction.fraction},
        {first_slope, scale * outside * beyond_mm * (1 - direction.fraction)},
        {second_slope, scale * outside * beyond_mm * direction.fraction},
    }};
    const std::size_t terms = row.size() - (has_slopes_ ? 0 : 2);
    for (std::size_t a = 0; a < terms; ++a) {
      sum.gradient[row[a].first] += weight * residual * row[a].second;
      for (std::size_t b = a; b < terms; ++b)
        sum.normal(row[a].first, row[b].first) += weight * row[a].second * row[b].second;
    }
  }

  void add_known(const Parameters& p, Equations& sum) const {
    for (Eigen::Index k = 0; k < count_; ++k) {
      const auto [mean, deviation] = known(k);
      if (deviation == 0) {
        sum.normal.row(k).setZero();
        sum.normal.col(k).setZero();
        sum.normal(k, k) = 1;
        sum.gradient[k] = 0;
        continue;
      }
      const double off = (mean - p[k]) / deviation;
      sum.cost += off * off;
      sum.normal(k, k) += 1 / (deviation * deviation);
      sum.gradient[k] += off / deviation;
      // A direction without samples stays where it is.
      constexpr double kHardly = 1e-9;
      sum.normal(k, k) += kHardly;
    }
  }

  std::optional<TubeAnswer> answer_of(const Parameters& p, const Equations& sum) const {
    if (!p.allFinite() || sum.weight_in <= 0) return std::nullopt;
    const Matrix covariance = sum.normal.ldlt().solve(Matrix::Identity(count_, count_));
    return TubeAnswer{tube_of(p),
                      std::sqrt(std::max(covariance(kRadius, kRadius), 0.0)),
                      std::sqrt(std::max(covariance(kLumen, kLumen), 0.0)),
                      std::sqrt(sum.squares_hu2 / sum.weight_in),
                      std::sqrt(sum.all_squares_hu2 / sum.weight),
                      sum.weight,
                      sum.weight_in / sum.weight};
  }

  std::span<const SampleAcross> samples_;
  const TubeQuestion& question_;
  bool has_slopes_;
  Eigen::Index count_;  ///< of parameters
  std::array<Known, kMost> known_;
  std::vector<Direction> directions_;
};

}  // namespace

double Tube::contrast_hu() const {
  return lumen_hu - std::reduce(around_hu.begin(), around_hu.end()) / static_cast<double>(kDirections);
}

std::size_t nearest_direction(const glm::dvec2& at_mm) {
  const Direction direction = direction_of(at_mm);
  return static_cast<std::size_t>(direction.fraction < 0.5 ? direction.first : direction.second);
}

std::optional<TubeAnswer> fit_tube(std::span<const SampleAcross> samples, const TubeQuestion& question) {
  constexpr std::size_t kFewest = 12;
  if (samples.size() < kFewest) return std::nullopt;
  return TubeFit(samples, question).answer();
}

}  // namespace xraycast
