#include "xraycast/sampling/shell_halves.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace xraycast {
namespace {

/// The coefficients of the means of four adjacent cells, two on either side of 0, in the slope at 0 of the
/// polynomial through their running sum (Lagrange's, through the ends of the cells).
std::array<float, 4> slope_of_sum(const std::array<double, 4>& cells_mm) {
  const std::array<double, 5> ends{-cells_mm[0] - cells_mm[1], -cells_mm[1], 0, cells_mm[2],
                                   cells_mm[2] + cells_mm[3]};
  std::array<double, 5> of_ends{};  // of the running sum there
  for (std::size_t i = 0; i < 5; ++i) {
    if (i == 2) continue;
    double product = 1 / ends[i];
    for (std::size_t j = 0; j < 5; ++j)
      if (j != i && j != 2) product *= -ends[j] / (ends[i] - ends[j]);
    of_ends[i] = product;
  }
  // In the middle too, but nothing depends on where the running sum begins.
  of_ends[2] = -(of_ends[0] + of_ends[1] + of_ends[3] + of_ends[4]);
  // A cell counts in the sums at all the ends behind it.
  std::array<float, 4> of_means{};
  double behind = 0;
  for (std::size_t cell = 4; cell-- > 0;) {
    behind += of_ends[cell + 1];
    of_means[cell] = static_cast<float>(behind * cells_mm[cell]);
  }
  return of_means;
}

}  // namespace

std::vector<double> halved_radii_mm(std::span<const double> radii_mm) {
  std::vector<double> halved{radii_mm.front()};
  for (std::size_t k = 0; k + 1 < radii_mm.size(); ++k) {
    halved.push_back(0.5 * (radii_mm[k] + radii_mm[k + 1]));
    halved.push_back(radii_mm[k + 1]);
  }
  return halved;
}

ShellHalves::ShellHalves(std::span<const double> radii_mm) : edges_mm_(radii_mm.begin(), radii_mm.end()) {
  const auto layers = static_cast<std::ptrdiff_t>(edges_mm_.size()) - 1;
  assert(layers >= 2);  // what one shell holds says nothing about its halves
  const auto thickness_mm = [&](std::ptrdiff_t k) {
    const auto shell = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(k, 0, layers - 1));
    return edges_mm_[shell + 1] - edges_mm_[shell];
  };
  for (std::ptrdiff_t edge = 0; edge <= layers; ++edge)
    smooth_.push_back(slope_of_sum(
        {thickness_mm(edge - 2), thickness_mm(edge - 1), thickness_mm(edge), thickness_mm(edge + 1)}));
}

ShellHalves::Split ShellHalves::split(std::span<const double> reaches_mm) const {
  Split split;
  split.layers_ = edges_mm_.size() - 1;
  split.texels_ = reaches_mm.size();
  split.smooth_ = smooth_;
  for (std::size_t k = 0; k < split.layers_; ++k) {
    const double inner = edges_mm_[k], middle = 0.5 * (inner + edges_mm_[k + 1]);
    for (const double reach_mm : reaches_mm) {
      const double outer = std::clamp(reach_mm, inner, edges_mm_[k + 1]), length = outer - inner;
      const double in_inner = std::min(outer, middle) - inner, in_outer = length - in_inner;
      split.per_mm_.push_back(static_cast<float>(length > 0 ? 1 / length : 0));
      split.inner_mm_.push_back(static_cast<float>(in_inner));
      split.outer_mm_.push_back(static_cast<float>(in_outer));
      split.gain_mm_.push_back(static_cast<float>(length > 0 ? in_inner * in_outer / (2 * length) : 0));
    }
  }
  return split;
}

void ShellHalves::Split::halve(std::span<const float> shells, std::span<float> halves,
                               std::size_t stride) const {
  // The mean of mu over each shell, with two ghost shells on either side: extrapolated linearly towards the
  // axis, and constantly beyond the end of a ray.
  std::vector<float> means((layers_ + 4) * texels_), edges(2 * texels_);
  const auto mean = [&](std::size_t k) { return &means[(k + 2) * texels_]; };
  for (std::size_t k = 0; k < layers_; ++k) {
    const float *sum = &shells[k * texels_], *per_mm = &per_mm_[k * texels_];
    const float* before = k > 0 ? mean(k - 1) : sum;
    for (std::size_t i = 0; i < texels_; ++i) mean(k)[i] = per_mm[i] > 0 ? sum[i] * per_mm[i] : before[i];
  }
  for (std::size_t i = 0; i < texels_; ++i) {
    const float here = mean(0)[i], fall = here - mean(1)[i], last = mean(layers_ - 1)[i];
    means[texels_ + i] = here + fall;
    means[i] = here + 2 * fall;
    mean(layers_)[i] = mean(layers_ + 1)[i] = last;
  }

  const auto estimate = [&](std::size_t edge, float* at_edge) {
    constexpr float kEven = 1e-7f;  // per mm: where mu is flat on both sides, both count alike
    const auto [c0, c1, c2, c3] = smooth_[edge];
    const float* m = &means[edge * texels_];  // of the second shell before the edge
    for (std::size_t i = 0; i < texels_; ++i) {
      const float m0 = m[i], m1 = m[texels_ + i], m2 = m[2 * texels_ + i], m3 = m[3 * texels_ + i];
      const float change_behind = std::abs(m3 - m2) + kEven, change_before = std::abs(m1 - m0) + kEven;
      const float akima = (change_behind * m1 + change_before * m2) / (change_behind + change_before);
      at_edge[i] = 0.5f * (akima + c0 * m0 + c1 * m1 + c2 * m2 + c3 * m3);
    }
  };
  float *at_inner = edges.data(), *at_outer = at_inner + texels_;
  estimate(0, at_inner);
  for (std::size_t k = 0; k < layers_; ++k) {
    estimate(k + 1, at_outer);
    const float *mu = mean(k), *in_inner = &inner_mm_[k * texels_], *in_outer = &outer_mm_[k * texels_],
                *gain = &gain_mm_[k * texels_];
    float *inner = &halves[2 * k * stride], *outer = inner + stride;
    // One output a loop, or there are too many to vectorise it.
    for (std::size_t i = 0; i < texels_; ++i) at_inner[i] = gain[i] * (at_outer[i] - at_inner[i]);
    for (std::size_t i = 0; i < texels_; ++i) inner[i] = in_inner[i] * mu[i] - at_inner[i];
    for (std::size_t i = 0; i < texels_; ++i) outer[i] = in_outer[i] * mu[i] + at_inner[i];
    std::swap(at_inner, at_outer);
  }
}

}  // namespace xraycast
