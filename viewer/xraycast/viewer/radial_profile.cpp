#include "xraycast/viewer/radial_profile.hpp"

#include <algorithm>

namespace xraycast {

RadialProfile::RadialProfile(std::span<const double> radii_mm, Reconstruction reconstruction)
    : edges_mm_(radii_mm.begin(), radii_mm.end()), reconstruction_(reconstruction) {
  for (std::size_t k = 0; k + 1 < edges_mm_.size(); ++k) {
    middles_mm_.push_back(0.5 * (edges_mm_[k] + edges_mm_[k + 1]));
    thickness_mm_.push_back(edges_mm_[k + 1] - edges_mm_[k]);
  }
  if (reconstruction == Reconstruction::constant || layers() == 1) {
    knots_mm_ = edges_mm_;
  } else {
    knots_mm_ = {edges_mm_.front()};
    knots_mm_.insert(knots_mm_.end(), middles_mm_.begin(), middles_mm_.end());
    knots_mm_.push_back(edges_mm_.back());
  }

  // The mean over shell k of the function through all middles is a quarter of what the neighbours give at its
  // edges, for each of its halves, and the rest its own.
  const std::size_t count = middles_mm_.size();
  double upper_before = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const bool linear = reconstruction == Reconstruction::linear;
    const double half = 0.5 * thickness_mm_[k];
    const double below = linear && k > 0 ? 0.25 * half / (middles_mm_[k] - middles_mm_[k - 1]) : 0;
    const double above = linear && k + 1 < count ? 0.25 * half / (middles_mm_[k + 1] - middles_mm_[k]) : 0;
    const double pivot = 1 - below - above - below * upper_before;
    upper_before = above / pivot;
    below_.push_back(static_cast<float>(below));
    upper_.push_back(static_cast<float>(upper_before));
    pivot_.push_back(static_cast<float>(1 / pivot));
  }
}

void RadialProfile::solve(std::span<float> values, std::size_t layer_stride, std::size_t count) const {
  const std::size_t layers = thickness_mm_.size();
  for (std::size_t k = 0; k < layers; ++k) {
    float* row = &values[k * layer_stride];
    const float* before = k > 0 ? row - layer_stride : row;  // multiplied by 0 in the first layer
    const auto per_mm = static_cast<float>(1 / thickness_mm_[k]);
    const float below = below_[k], pivot = pivot_[k];
    for (std::size_t i = 0; i < count; ++i) row[i] = (row[i] * per_mm - below * before[i]) * pivot;
  }
  for (std::size_t k = layers - 1; k-- > 0;) {
    float* row = &values[k * layer_stride];
    const float* next = row + layer_stride;
    for (std::size_t i = 0; i < count; ++i) row[i] -= upper_[k] * next[i];
  }
}

RadialProfile::Place RadialProfile::at(double radius_mm) const {
  const int last = layers() - 1;
  if (reconstruction_ == Reconstruction::constant || last == 0) {
    const auto edge = std::upper_bound(edges_mm_.begin(), edges_mm_.end(), radius_mm);
    const int layer = std::clamp(static_cast<int>(edge - edges_mm_.begin()) - 1, 0, last);
    return {layer, 0};
  }
  const auto above = std::upper_bound(middles_mm_.begin(), middles_mm_.end(), radius_mm);
  const int layer = std::clamp(static_cast<int>(above - middles_mm_.begin()) - 1, 0, last - 1);
  const double share = (radius_mm - middles_mm_[layer]) / (middles_mm_[layer + 1] - middles_mm_[layer]);
  return {layer, std::clamp(share, 0.0, 1.0)};
}

}  // namespace xraycast
