#include "xraycast/registration/pose_fit.hpp"

#include "xraycast/base/parallel.hpp"
#include "xraycast/registration/similarity.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

namespace xraycast {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// A rotation by a hundredth of a radian moves the body's border about as far as a millimetre.
const Vector6 kUnits = (Vector6() << 1, 1, 1, 0.01, 0.01, 0.01).finished();

/// Whether the scan's middle lies before the camera. A pose that has it behind is not worth a projection.
bool is_before(const PinholeCamera& camera, const VolumeGeometry& volume) {
  const glm::dvec3 middle = volume.middle_mm();
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

/// Where a view shows the scan, and what the filters of its edges reach beside it; as much as the view has.
/// Never less than 16 x 16 pixels, unless the view is smaller.
PictureBox shown_box(const ViewLevel& view, const PinholeCamera& camera, const VolumeGeometry& scan) {
  constexpr double kBeside = 8, kLeast_mm = 1;
  constexpr int kSmallest = 16;
  glm::dvec2 low(1e6), high(-1e6);
  for (const glm::dvec3& seen : corners_before(camera, scan)) {
    if (!(seen.z > kLeast_mm)) return {0, 0, view.camera.width, view.camera.height};
    const glm::dvec2 pixel(camera.intrinsics * (seen / seen.z));
    low = glm::min(low, pixel);
    high = glm::max(high, pixel);
  }
  const auto range = [&](double from, double to, int size) {
    const int smallest = std::min(kSmallest, size),
              first = static_cast<int>(std::clamp(std::floor(from - kBeside), 0.0, 1.0 * (size - smallest))),
              end = static_cast<int>(
                  std::clamp(std::ceil(to + kBeside) + 1, 1.0 * first + smallest, 1.0 * size));
    return std::pair(first, end);
  };
  const auto [left, right] = range(low.x, high.x, view.camera.width);
  const auto [top, bottom] = range(low.y, high.y, view.camera.height);
  return {left, top, right, bottom};
}

/// A view's similarity.
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

/// Of pictures' edges, and of their changes with the pose; none of these where only the pose is wanted.
struct EdgesWithSlopes {
  Edges edges;
  std::array<Edges, 6> slopes{};
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

/// Squares of differences, but for large ones: those grow towards the threshold's square (Geman and McClure,
/// Bull. ISI 52, 1987).
double cost_of(double size, double threshold) {
  const double ratio = size / threshold;
  return size * size / (1 + ratio * ratio);
}

/// With which the squares have the same slope.
double weight_of(double size, double threshold) {
  const double ratio = size / threshold, one = 1 / (1 + ratio * ratio);
  return one * one;
}

/// By how much a picture's edges must be multiplied to be those of another, where that differs from place to
/// place: scatter and the chain behind the detector change contrast slowly.
class LocalGains {
 public:
  /// Of `part` of a view of that size, over which the nodes lie.
  LocalGains(int width, int height, const PictureBox& part) : width_(width), height_(height), part_(part) {}

  /// One a pixel, at least 0: between nodes, each by a regression of the pixels around it. What differs by
  /// more than the threshold counts less (Geman and McClure).
  std::vector<float> fitted(const std::vector<float>& wanted, const std::vector<float>& own,
                            const std::vector<std::uint8_t>& counted, double threshold) const {
    std::vector<float> gains(wanted.size(), 1);
    const int rounds = threshold == std::numeric_limits<double>::infinity() ? 1 : 3;
    for (int round = 0; round < rounds; ++round) {
      Sums sums;
      for_each(counted, [&](std::size_t i, const Corners& corners) {
        const double size = std::abs(wanted[i] - gains[i] * own[i]), weight = weight_of(size, threshold);
        for (const auto& [node, share] : corners) {
          sums.product[node] += share * weight * wanted[i] * own[i];
          sums.square[node] += share * weight * own[i] * own[i];
        }
      });
      const Nodes nodes = sums.gains();
      for_each(counted, [&](std::size_t i, const Corners& corners) {
        double gain = 0;
        for (const auto& [node, share] : corners) gain += share * nodes[node];
        gains[i] = static_cast<float>(gain);
      });
    }
    return gains;
  }

 private:
  static constexpr std::size_t kSide = 6;  ///< nodes along each side
  using Nodes = std::array<double, kSide * kSide>;
  using Corners = std::array<std::pair<std::size_t, double>, 4>;

  struct Sums {
    Nodes product{}, square{};
    /// Those of all pixels where a node has few.
    Nodes gains() const {
      const double all_squares = std::accumulate(square.begin(), square.end(), 0.0),
                   all = std::accumulate(product.begin(), product.end(), 0.0) / std::max(all_squares, 1e-30);
      const double more = 0.1 * all_squares / static_cast<double>(square.size()) + 1e-30;
      Nodes gains{};
      for (std::size_t n = 0; n < gains.size(); ++n)
        gains[n] = std::max((product[n] + more * all) / (square[n] + more), 0.0);
      return gains;
    }
  };

  template <typename Visit>
  void for_each(const std::vector<std::uint8_t>& counted, const Visit& visit) const {
    const auto place = [](int at, int count) {
      const double along = static_cast<double>(at) / std::max(count - 1, 1) * (kSide - 1);
      const auto first = std::min(static_cast<std::size_t>(along), kSide - 2);
      return std::pair(first, along - static_cast<double>(first));
    };
    std::size_t next = 0;
    for (int y = part_.top; y < part_.bottom; ++y) {
      const auto [row, down] = place(y, height_);
      for (int x = part_.left; x < part_.right; ++x) {
        const std::size_t i = next++;
        if (counted[i] == 0) continue;
        const auto [column, across] = place(x, width_);
        const std::size_t node = row * kSide + column;
        visit(i, Corners{{{node, (1 - down) * (1 - across)},
                          {node + 1, (1 - down) * across},
                          {node + kSide, down * (1 - across)},
                          {node + kSide + 1, down * across}}});
      }
    }
  }

  int width_, height_;
  PictureBox part_;
};

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
  double cost = 0;                     ///< Geman and McClure's
  std::vector<double> similarities{};  ///< of each view
  std::int64_t count = 0;
  Vector6 slope = Vector6::Zero();  ///< zero, as is `normal`, of a fit without derivatives
  Matrix6 normal = Matrix6::Zero();
  std::vector<double> sizes{};  ///< of the differences, where a threshold is still wanted
};

std::vector<double> PoseFit::similarities(std::span<const RigidMotion> motions, Progress& progress) const {
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
    // Parts of one size, since they are projected at once.
    std::vector<PictureBox> parts;
    glm::ivec2 size(0);
    for (const std::size_t m : seen) {
      const PictureBox part =
          parts.emplace_back(shown_box(view, seeing(view.camera, motions[m]), scan_.geometry()));
      size = glm::max(size, glm::ivec2(part.right - part.left, part.bottom - part.top));
    }
    std::vector<PinholeCamera> cameras;
    for (std::size_t n = 0; n < seen.size(); ++n) {
      PictureBox& part = parts[n];
      part.left = std::min(part.left, view.camera.width - size.x);
      part.top = std::min(part.top, view.camera.height - size.y);
      part = {part.left, part.top, part.left + size.x, part.top + size.y};
      cameras.push_back(seeing(camera_of(view, part), motions[seen[n]]));
    }
    const std::vector<float> depths =
        project(scan_, cameras, Opacity::paper(), progress, Sampling::everywhere);
    projections_ += std::ssize(cameras);
    const std::size_t pixels = depths.size() / seen.size();
    parallel_for(std::ssize(seen), [&](std::int64_t number) {
      const auto n = static_cast<std::size_t>(number);
      const auto first = depths.begin() + static_cast<std::ptrdiff_t>(n * pixels);
      const double one =
          similarity_of({first, first + static_cast<std::ptrdiff_t>(pixels)}, part_of(view, parts[n]));
      sums[seen[n]] += one / static_cast<double>(views_.size());
    });
  }
  return sums;
}

std::vector<ToneCurve> PoseFit::tones_at(const RigidMotion& motion, std::span<const ToneCurve> now,
                                         Progress& progress) const {
  std::vector<ToneCurve> curves(now.begin(), now.end());
  for (std::size_t v = 0; v < views_.size(); ++v) {
    const PinholeCamera whole = seeing(views_[v].camera, motion);
    if (!is_before(whole, scan_.geometry())) continue;
    const ViewLevel view = part_of(views_[v], shown_box(views_[v], whole, scan_.geometry()));
    const PinholeCamera camera = seeing(view.camera, motion);
    const std::vector<float> means =
        spread(project(scan_, camera, Opacity::paper(), progress, Sampling::everywhere), view);
    ++projections_;
    curves[v] = ToneCurve::fitted(view.greys, means, showing(means, view), now[v]);
  }
  return curves;
}

/// What a view shows of a pose: the part of it that is compared, and edges with their changes.
struct PoseFit::Seen {
  const ViewLevel* whole;
  PictureBox part;
  ViewLevel view;
  std::vector<std::uint8_t> shown{};
  EdgesWithSlopes moving{};
};

std::vector<PoseFit::Seen> PoseFit::seen_from(const RigidMotion& motion, bool with_slopes,
                                              Progress& progress) const {
  std::vector<Seen> all;
  for (const ViewLevel& whole : views_) {
    const PinholeCamera camera = seeing(whole.camera, motion);
    if (!is_before(camera, scan_.geometry())) return {};
    const PictureBox part = shown_box(whole, camera, scan_.geometry());
    Seen& seen = all.emplace_back(Seen{.whole = &whole, .part = part, .view = part_of(whole, part)});
    const PinholeCamera there = seeing(seen.view.camera, motion);
    PoseGradient picture;
    if (with_slopes)
      picture = project_with_gradient(scan_, there, Opacity::paper(), progress);
    else
      picture.tau = project(scan_, there, Opacity::paper(), progress, Sampling::everywhere);
    ++projections_;
    const std::vector<float> means = spread(std::move(picture.tau), seen.view);
    seen.shown = showing(means, seen.view);
    if (with_slopes)
      seen.moving = edges_with_slopes(means, picture.gradient, seen.view);
    else
      seen.moving.edges = edges_of(means, seen.view.camera.width, seen.view.camera.height);
  }
  return all;
}

/// Of a view's edges along one direction.
PoseFit::Linear PoseFit::fit_of(const Seen& seen, EdgesOf edges, double threshold) const {
  const auto& [whole, part, view, shown, moving] = seen;
  const std::vector<float>&f = view.edges.*edges, &m = moving.edges.*edges;
  const Normal of_f = normal_of(f, shown), of_m = normal_of(m, shown);
  Linear fit;
  fit.similarities = {0};
  if (!(of_f.norm > 0) || !(of_m.norm > 0)) return fit;
  const bool has_slopes = !(moving.slopes[0].*edges).empty();
  const auto slope_at = [&slopes = moving.slopes, edges](std::size_t k, std::size_t i) -> double {
    return (slopes[k].*edges)[i];
  };
  // A change of the pose changes mean and norm too: what is left of it is orthogonal to both.
  Vector6 slope_mean = Vector6::Zero(), along = Vector6::Zero();
  double count = 0, product = 0;
  std::vector<float> wanted(f.size()), own(f.size());
  for (std::size_t i = 0; i < f.size(); ++i) {
    if (shown[i] == 0) continue;
    ++count;
    own[i] = static_cast<float>((m[i] - of_m.mean) / of_m.norm);
    wanted[i] = static_cast<float>((f[i] - of_f.mean) / of_f.norm);
    product += static_cast<double>(own[i]) * wanted[i];
    for (int k = 0; has_slopes && k < 6; ++k) {
      const double slope = slope_at(static_cast<std::size_t>(k), i);
      slope_mean[k] += slope;
      along[k] += slope * own[i];
    }
  }
  slope_mean /= count;
  fit.similarities = {0.5 * product};
  const std::vector<float> gains =
      LocalGains(whole->camera.width, whole->camera.height, part).fitted(wanted, own, shown, threshold);
  for (std::size_t i = 0; i < f.size(); ++i) {
    if (shown[i] == 0) continue;
    const double rest = wanted[i] - gains[i] * own[i], size = std::abs(rest),
                 weight = weight_of(size, threshold);
    if (threshold == std::numeric_limits<double>::infinity()) fit.sizes.push_back(rest);
    fit.cost += cost_of(size, threshold);
    ++fit.count;
    if (!has_slopes) continue;
    Vector6 slope;
    for (int k = 0; k < 6; ++k)
      slope[k] = gains[i] * (slope_at(static_cast<std::size_t>(k), i) - slope_mean[k] - own[i] * along[k]) /
                 of_m.norm * kUnits[k];
    fit.slope += weight * rest * slope;
    fit.normal.selfadjointView<Eigen::Lower>().rankUpdate(slope, weight);
  }
  return fit;
}

PoseFit::Linear PoseFit::linear_fit(std::span<const Seen> seen, double threshold) const {
  constexpr std::array<EdgesOf, 2> kDirections{&Edges::across, &Edges::down};
  std::vector<Linear> parts(2 * seen.size());
  parallel_for(std::ssize(parts), [&](std::int64_t number) {
    const auto n = static_cast<std::size_t>(number);
    parts[n] = fit_of(seen[n / 2], kDirections[n % 2], threshold);
  });
  Linear fit;
  fit.similarities.resize(seen.size());
  if (seen.empty()) fit.cost = std::numeric_limits<double>::infinity();
  for (std::size_t n = 0; n < parts.size(); ++n) {
    fit.cost += parts[n].cost;
    fit.count += parts[n].count;
    fit.similarities[n / 2] += parts[n].similarities[0];
    fit.slope += parts[n].slope;
    fit.normal += parts[n].normal;
    fit.sizes.insert(fit.sizes.end(), parts[n].sizes.begin(), parts[n].sizes.end());
  }
  fit.normal = fit.normal.selfadjointView<Eigen::Lower>();
  return fit;
}

/// In mm where the scan's middle is, as the first view shows it.
double PoseFit::pixel_mm(const RigidMotion& motion) const {
  const PinholeCamera camera = seeing(views_[0].camera, motion);
  const glm::dvec3 middle = scan_.geometry().middle_mm();
  const double depth_mm = (camera.rotation * middle + camera.translation_mm).z;
  return std::abs(depth_mm / camera.intrinsics[0][0]);
}

PoseFit::Refined PoseFit::refine(const RigidMotion& start, int most_steps, Progress& progress) const {
  const glm::dvec3 middle = scan_.geometry().middle_mm();
  // Less is not told apart at this level.
  constexpr double kSmallestShare = 0.01, kSmallestGain = 1e-5;
  const double smallest_mm = kSmallestShare * pixel_mm(start);
  RigidMotion motion = start;
  const std::vector<Seen> first = seen_from(motion, true, progress);
  Linear fit = linear_fit(first, std::numeric_limits<double>::infinity());
  // Three times the standard deviation, by the median of the differences' sizes.
  const double threshold = 3 * 1.4826 * median_of_sizes(std::move(fit.sizes));
  if (threshold > 0) fit = linear_fit(first, threshold);
  Matrix6 normal = fit.normal;
  double damping = 1e-3;
  int steps = 0;
  while (steps < most_steps && fit.count > 0 && damping < 1e6) {
    Matrix6 damped = fit.normal;
    damped.diagonal() *= 1 + damping;
    damped.diagonal().array() += 1e-12 * fit.normal.trace() + 1e-30;
    const Vector6 step = kUnits.cwiseProduct(damped.ldlt().solve(fit.slope));
    if (!step.allFinite() || step.cwiseQuotient(kUnits).norm() < smallest_mm) break;
    ++steps;
    // The derivatives are those by source and detector, which move against the scan.
    const RigidMotion trial = motion.after(
        turned_and_moved({step[3], step[4], step[5]}, {step[0], step[1], step[2]}, middle).inverse());
    const bool goes_on = steps < most_steps;
    Linear after = linear_fit(seen_from(trial, goes_on, progress), threshold > 0 ? threshold : 1);
    const bool is_better = after.cost < fit.cost;
    const double gain = is_better ? 1 - after.cost / fit.cost : 0;
    if (is_better) {
      motion = trial;
      fit = std::move(after);
      if (goes_on) normal = fit.normal;
      damping = std::max(damping / 5, 1e-9);
    } else {
      damping *= 10;
    }
    if (is_better && gain < kSmallestGain) break;
  }
  Refined refined{.motion = motion, .similarities = fit.similarities, .sd = {}, .steps = steps};
  if (fit.count == 0) refined.similarities.assign(views_.size(), -1);
  if (fit.count > 6) {
    // Edges of neighbouring pixels share their noise: about so many count as one.
    constexpr double kShared = 6;
    const double variance = kShared * fit.cost / static_cast<double>(fit.count - 6);
    const Matrix6 covariance = variance * normal.inverse();
    for (int k = 0; k < 6; ++k)
      refined.sd[static_cast<std::size_t>(k)] = kUnits[k] * std::sqrt(std::max(covariance(k, k), 0.0));
  }
  return refined;
}

double PoseFit::Refined::similarity() const {
  return std::reduce(similarities.begin(), similarities.end()) / static_cast<double>(similarities.size());
}

}  // namespace xraycast
