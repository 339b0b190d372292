#include "xraycast/registration/pose_fit.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/registration/similarity.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace xraycast {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// A rotation by a hundredth of a radian moves the body's border about as far as a millimetre.
const Vector6 kUnits = (Vector6() << 1, 1, 1, 0.01, 0.01, 0.01).finished();

/// Whether some of the scan lies before the camera, so that it can be projected.
bool is_before(const PinholeCamera& camera, const VolumeGeometry& volume) {
  const glm::dvec3 middle = 0.5 * (volume.lower_mm() + volume.upper_mm());
  return (camera.rotation * middle + camera.translation_mm).z > 0;
}

/// Pixels that show the scan, or lie as near to it as its edges reach.
std::vector<std::uint8_t> showing(std::span<const float> depths, const ViewLevel& view) {
  constexpr float kLeast = 0.01F;  // of optical depth; half a millimetre of water
  constexpr int kBeside = 3;
  const int width = view.camera.width, height = view.camera.height;
  const auto at = [&](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  };
  std::vector<std::uint8_t> rows(depths.size()), shown(depths.size());
  for (int y = 0; y < height; ++y)
    for (int x = 0, last = -kBeside - 1; x < width + kBeside; ++x) {
      if (x < width && depths[at(x, y)] > kLeast) last = x;
      if (x >= kBeside && x - last <= 2 * kBeside) rows[at(x - kBeside, y)] = 1;
    }
  for (int x = 0; x < width; ++x)
    for (int y = 0, last = -kBeside - 1; y < height + kBeside; ++y) {
      if (y < height && rows[at(x, y)] != 0) last = y;
      if (y >= kBeside && y - last <= 2 * kBeside)
        shown[at(x, y - kBeside)] = view.counted[at(x, y - kBeside)];
    }
  return shown;
}

/// Of the pixels that count.
struct Normal {
  double mean = 0, norm = 0;
};

Normal normal_of(std::span<const float> values, std::span<const std::uint8_t> counted) {
  double sum = 0, squares = 0;
  std::int64_t count = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (counted[i] == 0) continue;
    sum += values[i];
    squares += static_cast<double>(values[i]) * values[i];
    ++count;
  }
  if (count == 0) return {};
  const double mean = sum / static_cast<double>(count);
  return {mean, std::sqrt(std::max(squares - sum * mean, 0.0))};
}

/// A view's similarity. Where less of the scan is shown than elsewhere in the picture could be, chance makes
/// pictures alike: below a quarter of the pixels that count, the value is reduced.
double similarity_of(std::vector<float> depths, const ViewLevel& view) {
  const std::vector<float> means = spread(std::move(depths), view);
  const std::vector<std::uint8_t> shown = showing(means, view);
  const Edges edges = edges_of(means, view.camera.width, view.camera.height);
  const auto ncc = [&](const std::vector<float>& fixed, const std::vector<float>& moving) {
    return similarity::ncc({view.camera.width, view.camera.height, fixed, moving, shown});
  };
  return 0.5 * (ncc(view.edges.across, edges.across) + ncc(view.edges.down, edges.down));
}

/// Numbers 6 i + k of a picture's gradient.
std::vector<float> channel(std::span<const float> gradient, std::size_t k) {
  std::vector<float> values(gradient.size() / 6);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = gradient[6 * i + k];
  return values;
}

/// Of pictures' edges, and of their changes with the pose.
struct EdgesWithSlopes {
  Edges edges;
  std::array<Edges, 6> slopes;
};

EdgesWithSlopes edges_with_slopes(const std::vector<float>& means, std::span<const float> gradient,
                                  const ViewLevel& view) {
  EdgesWithSlopes all;
  parallel_for(7, [&](std::int64_t k) {
    const int width = view.camera.width, height = view.camera.height;
    if (k == 6)
      all.edges = edges_of(means, width, height);
    else
      all.slopes[static_cast<std::size_t>(k)] =
          edges_of(spread(channel(gradient, static_cast<std::size_t>(k)), view), width, height);
  });
  return all;
}

/// One number a pixel and direction, from pairs of pictures.
template <typename Visit>
void for_both(const Visit& visit) {
  visit(&Edges::across);
  visit(&Edges::down);
}

double median_of_sizes(std::vector<double> values) {
  if (values.empty()) return 0;
  for (double& value : values) value = std::abs(value);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

}  // namespace

/// The differences of normalised edges about a pose, as sums over their pixels: with a step s, given in
/// kUnits, their weighted squares are cost - 2 slope * s + s * normal * s.
struct PoseFit::Linear {
  double cost = 0, similarity = 0;  ///< Huber's; the mean over the views
  std::int64_t count = 0;
  Vector6 slope = Vector6::Zero();
  Matrix6 normal = Matrix6::Zero();
  std::vector<double> sizes{};  ///< of the differences, where a threshold is still wanted
};

std::vector<double> PoseFit::similarities(std::span<const RigidMotion> motions, bool are_inverted,
                                          Progress& progress) const {
  std::vector<double> sums(motions.size(), 0);
  std::vector<std::size_t> seen;
  for (std::size_t m = 0; m < motions.size(); ++m) {
    const bool is_seen = std::ranges::all_of(views_, [&](const ViewLevel& view) {
      return is_before(seeing(view.camera, motions[m]), scan_.geometry());
    });
    if (is_seen)
      seen.push_back(m);
    else
      sums[m] = -1;
  }
  if (seen.empty()) return sums;
  for (const ViewLevel& view : views_) {
    std::vector<PinholeCamera> cameras;
    for (const std::size_t m : seen) cameras.push_back(seeing(view.camera, motions[m]));
    const std::vector<float> depths =
        project(scan_, cameras, Opacity::paper(), progress, Sampling::everywhere);
    projections_ += std::ssize(cameras);
    const std::size_t pixels = depths.size() / seen.size();
    parallel_for(std::ssize(seen), [&](std::int64_t n) {
      const auto first =
          depths.begin() + static_cast<std::ptrdiff_t>(n) * static_cast<std::ptrdiff_t>(pixels);
      const double one = similarity_of({first, first + static_cast<std::ptrdiff_t>(pixels)}, view);
      sums[seen[static_cast<std::size_t>(n)]] +=
          (are_inverted ? -one : one) / static_cast<double>(views_.size());
    });
  }
  return sums;
}

std::vector<double> PoseFit::similarities_of_views(const RigidMotion& motion, Progress& progress) const {
  std::vector<double> all;
  for (const ViewLevel& view : views_)
    all.push_back(
        PoseFit(scan_, std::span(&view, 1)).similarities(std::span(&motion, 1), false, progress)[0]);
  return all;
}

void PoseFit::add_view(const ViewLevel& view, const PoseGradient& picture, double threshold,
                       Linear& fit) const {
  const std::vector<float> means = spread(picture.tau, view);
  const std::vector<std::uint8_t> shown = showing(means, view);
  const EdgesWithSlopes moving = edges_with_slopes(means, picture.gradient, view);
  for_both([&](auto edges) {
    const std::vector<float>&f = view.edges.*edges, &m = moving.edges.*edges;
    const Normal of_f = normal_of(f, shown), of_m = normal_of(m, shown);
    if (!(of_f.norm > 0) || !(of_m.norm > 0)) return;
    // A change of the pose changes mean and norm too: what is left of it is orthogonal to both.
    Vector6 slope_mean = Vector6::Zero(), along = Vector6::Zero();
    double count = 0, product = 0;
    for (std::size_t i = 0; i < f.size(); ++i) {
      if (shown[i] == 0) continue;
      ++count;
      const double own = (m[i] - of_m.mean) / of_m.norm;
      product += own * (f[i] - of_f.mean) / of_f.norm;
      for (int k = 0; k < 6; ++k) {
        const double slope = (moving.slopes[static_cast<std::size_t>(k)].*edges)[i];
        slope_mean[k] += slope;
        along[k] += slope * own;
      }
    }
    slope_mean /= count;
    fit.similarity += 0.5 * product / static_cast<double>(views_.size());
    for (std::size_t i = 0; i < f.size(); ++i) {
      if (shown[i] == 0) continue;
      const double own = (m[i] - of_m.mean) / of_m.norm, rest = (f[i] - of_f.mean) / of_f.norm - own;
      Vector6 slope;
      for (int k = 0; k < 6; ++k)
        slope[k] = ((moving.slopes[static_cast<std::size_t>(k)].*edges)[i] - slope_mean[k] - own * along[k]) /
                   of_m.norm * kUnits[k];
      const double size = std::abs(rest), weight = size > threshold ? threshold / size : 1;
      if (threshold == std::numeric_limits<double>::infinity()) fit.sizes.push_back(rest);
      fit.cost += size > threshold ? threshold * (2 * size - threshold) : rest * rest;
      fit.slope += weight * rest * slope;
      fit.normal.selfadjointView<Eigen::Lower>().rankUpdate(slope, weight);
      ++fit.count;
    }
  });
}

PoseFit::Linear PoseFit::linear_fit(const RigidMotion& motion, double threshold, Progress& progress) const {
  Linear fit;
  for (const ViewLevel& view : views_) {
    const PinholeCamera camera = seeing(view.camera, motion);
    if (!is_before(camera, scan_.geometry())) {
      fit.cost = std::numeric_limits<double>::infinity();
      return fit;
    }
    const PoseGradient picture = project_with_gradient(scan_, camera, Opacity::paper(), progress);
    ++projections_;
    add_view(view, picture, threshold, fit);
  }
  fit.normal = fit.normal.selfadjointView<Eigen::Lower>();
  return fit;
}

PoseFit::Refined PoseFit::refine(const RigidMotion& start, int most_steps, Progress& progress) const {
  const glm::dvec3 middle = 0.5 * (scan_.geometry().lower_mm() + scan_.geometry().upper_mm());
  RigidMotion motion = start;
  Linear fit = linear_fit(motion, std::numeric_limits<double>::infinity(), progress);
  // Twice the standard deviation, by the median of the differences' sizes.
  const double threshold = 2 * 1.4826 * median_of_sizes(std::move(fit.sizes));
  if (threshold > 0) fit = linear_fit(motion, threshold, progress);
  double damping = 1e-3;
  int steps = 0;
  while (steps < most_steps && fit.count > 0 && damping < 1e6) {
    ++steps;
    Matrix6 damped = fit.normal;
    damped.diagonal() *= 1 + damping;
    damped.diagonal().array() += 1e-12 * fit.normal.trace() + 1e-30;
    const Vector6 step = kUnits.cwiseProduct(damped.ldlt().solve(fit.slope));
    if (!step.allFinite()) break;
    // The derivatives are those by source and detector, which move against the scan.
    const RigidMotion trial = motion.after(
        turned_and_moved({step[3], step[4], step[5]}, {step[0], step[1], step[2]}, middle).inverse());
    Linear after = linear_fit(trial, threshold > 0 ? threshold : 1, progress);
    const bool is_better = after.cost < fit.cost;
    const double gain = is_better ? 1 - after.cost / fit.cost : 0;
    if (is_better) {
      motion = trial;
      fit = std::move(after);
      damping = std::max(damping / 5, 1e-9);
    } else {
      damping *= 10;
    }
    constexpr double kSmallest_mm = 0.002, kSmallestGain = 1e-5;
    const double length_mm = step.cwiseQuotient(kUnits).norm();
    if (length_mm < kSmallest_mm || (is_better && gain < kSmallestGain)) break;
  }
  Refined refined{
      .motion = motion, .similarity = fit.count > 0 ? fit.similarity : -1, .sd = {}, .steps = steps};
  if (fit.count > 6) {
    // Edges of neighbouring pixels share their noise: about so many count as one.
    constexpr double kShared = 6;
    const double variance = kShared * fit.cost / static_cast<double>(fit.count - 6);
    const Matrix6 covariance = variance * fit.normal.inverse();
    for (int k = 0; k < 6; ++k)
      refined.sd[static_cast<std::size_t>(k)] = kUnits[k] * std::sqrt(std::max(covariance(k, k), 0.0));
  }
  return refined;
}

}  // namespace xraycast
