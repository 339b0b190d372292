#include "xraycast/sampling/radial_profile.hpp"

#include <algorithm>
#include <cstddef>

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
}

RadialProfile::Row RadialProfile::row(std::size_t k, double reach_mm) const {
  const double inner = edges_mm_[k], outer = std::min(edges_mm_[k + 1], reach_mm), length = outer - inner;
  if (length <= 0) return {};
  const bool is_last = k + 1 == thickness_mm_.size() || edges_mm_[k + 1] >= reach_mm;
  const double middle = middles_mm_[k];
  Row row{0, 0, 1 / length};
  if (reconstruction_ == Reconstruction::constant) return row;
  // Between two middles mu runs linearly: over a stretch that begins or ends in the shell's own middle its
  // mean takes half of what the neighbour has at the other end. A ray that ends before the middle has only
  // the stretch from the inner edge on, and one that ends in the shell has no neighbour outwards.
  if (k > 0) {
    const double gap = middle - middles_mm_[k - 1], inwards = std::min(outer, middle) - inner;
    const double mean_at = inner + 0.5 * inwards;
    row.below = (middle - mean_at) / gap * inwards / length;
  }
  if (!is_last) {
    const double gap = middles_mm_[k + 1] - middle, outwards = outer - middle;
    row.above = 0.5 * outwards / gap * outwards / length;
  }
  return row;
}

RadialProfile::System RadialProfile::system(std::span<const double> reaches_mm) const {
  const std::size_t layers = thickness_mm_.size(), texels = reaches_mm.size();
  System system;
  system.layers_ = layers;
  system.texels_ = texels;
  for (auto* factors : {&system.per_mm_, &system.below_, &system.upper_, &system.pivot_})
    factors->resize(layers * texels);
  for (std::size_t i = 0; i < texels; ++i) {
    double upper_before = 0;
    for (std::size_t k = 0; k < layers; ++k) {
      const auto [below, above, per_mm] = row(k, reaches_mm[i]);
      const double pivot = 1 - below - above - below * upper_before;
      upper_before = above / pivot;
      system.per_mm_[k * texels + i] = static_cast<float>(per_mm);
      system.below_[k * texels + i] = static_cast<float>(below);
      system.upper_[k * texels + i] = static_cast<float>(upper_before);
      system.pivot_[k * texels + i] = static_cast<float>(1 / pivot);
      if (per_mm > 0 || k == 0) continue;
      system.below_[k * texels + i] = -1;  // as the layer before
    }
  }
  return system;
}

void RadialProfile::System::solve(std::span<float> values, std::size_t layer_stride) const {
  for (std::size_t k = 0; k < layers_; ++k) {
    float* row = &values[k * layer_stride];
    const float* before = k > 0 ? row - layer_stride : row;  // multiplied by 0 in the first layer
    const float *per_mm = &per_mm_[k * texels_], *below = &below_[k * texels_], *pivot = &pivot_[k * texels_];
    for (std::size_t i = 0; i < texels_; ++i) row[i] = (row[i] * per_mm[i] - below[i] * before[i]) * pivot[i];
  }
  for (std::size_t k = layers_ - 1; k-- > 0;) {
    float* row = &values[k * layer_stride];
    const float *next = row + layer_stride, *upper = &upper_[k * texels_];
    for (std::size_t i = 0; i < texels_; ++i) row[i] -= upper[i] * next[i];
  }
}

RadialProfile::LayerPosition RadialProfile::at(double radius_mm) const {
  const int last = layers() - 1;
  if (reconstruction_ == Reconstruction::constant || last == 0) {
    const auto edge = std::upper_bound(edges_mm_.begin(), edges_mm_.end(), radius_mm);
    const int layer = std::clamp(static_cast<int>(edge - edges_mm_.begin()) - 1, 0, last);
    return {layer, 0};
  }
  const auto above = std::upper_bound(middles_mm_.begin(), middles_mm_.end(), radius_mm);
  const int layer = std::clamp(static_cast<int>(above - middles_mm_.begin()) - 1, 0, last - 1);
  const double fraction = (radius_mm - middles_mm_[layer]) / (middles_mm_[layer + 1] - middles_mm_[layer]);
  return {layer, std::clamp(fraction, 0.0, 1.0)};
}

}  // namespace xraycast
