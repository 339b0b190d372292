#include "xraycast/registration/tone_curve.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

namespace xraycast {
namespace {

float depth_in(Tone tone, float share) {
  constexpr float kOffset = 0.03F;  // keeps the noise of dark pixels down
  switch (tone) {
    case Tone::intensity:
      return -share;
    case Tone::log_intensity:
      return -std::log(share + kOffset);
    case Tone::inverted_intensity:
      return share;
    case Tone::inverted_log_intensity:
      break;
  }
  return -std::log(1 - share + kOffset);
}

/// Means over pixels of about one grey.
struct Bin {
  double share = 0, depth = 0, pixels = 0;
  void add(const Bin& other) {
    const double sum = pixels + other.pixels;
    share += (other.share - share) * other.pixels / sum;
    depth += (other.depth - depth) * other.pixels / sum;
    pixels = sum;
  }
};

/// Of about as many pixels each; those of one grey are in one bin.
std::vector<Bin> bins_of(std::span<const float> shares, std::span<const float> depths,
                         std::vector<std::uint32_t> order) {
  constexpr std::size_t kBins = 96;
  const std::size_t pixels = order.size() / kBins + 1;
  std::ranges::sort(order, [&](std::uint32_t a, std::uint32_t b) { return shares[a] < shares[b]; });
  std::vector<Bin> bins;
  float last = -1;
  for (const std::uint32_t i : order) {
    if (bins.empty() || (bins.back().pixels >= static_cast<double>(pixels) && shares[i] != last))
      bins.emplace_back();
    bins.back().add({shares[i], depths[i], 1});
    last = shares[i];
  }
  return bins;
}

/// The monotone depths nearest to those of the bins: neighbours in the wrong order become one.
std::vector<Bin> monotone(const std::vector<Bin>& bins, bool ascends) {
  std::vector<Bin> pooled;
  for (const Bin& bin : bins) {
    pooled.push_back(bin);
    while (pooled.size() > 1 && (pooled[pooled.size() - 2].depth > pooled.back().depth) == ascends) {
      const Bin last = pooled.back();
      pooled.pop_back();
      pooled.back().add(last);
    }
  }
  return pooled;
}

bool is_ascending(const std::vector<Bin>& bins) {
  Bin all;
  for (const Bin& bin : bins) all.add(bin);
  double covariance = 0;
  for (const Bin& bin : bins) covariance += bin.pixels * (bin.share - all.share) * (bin.depth - all.depth);
  return covariance > 0;
}

}  // namespace

ToneCurve::ToneCurve(Tone tone) {
  for (std::size_t i = 0; i < kSamples; ++i)
    depths_[i] = depth_in(tone, static_cast<float>(i) / (kSamples - 1));
}

ToneCurve ToneCurve::fitted(std::span<const float> shares, std::span<const float> depths,
                            std::span<const std::uint8_t> counted, const ToneCurve& otherwise) {
  std::vector<std::uint32_t> order;
  for (std::size_t i = 0; i < shares.size(); ++i)
    if (counted[i] != 0) order.push_back(static_cast<std::uint32_t>(i));
  constexpr std::size_t kLeastPixels = 500;
  if (order.size() < kLeastPixels) return otherwise;
  std::vector<Bin> bins = bins_of(shares, depths, std::move(order));
  bins = monotone(bins, is_ascending(bins));
  if (bins.size() < 3) return otherwise;
  ToneCurve curve = otherwise;
  std::size_t above = 1;
  for (std::size_t i = 0; i < kSamples; ++i) {
    const double share = static_cast<double>(i) / (kSamples - 1);
    while (above + 1 < bins.size() && bins[above].share < share) ++above;
    const Bin &a = bins[above - 1], &b = bins[above];
    const double along = std::clamp((share - a.share) / (b.share - a.share), 0.0, 1.0);
    curve.depths_[i] = static_cast<float>(std::lerp(a.depth, b.depth, along));
  }
  return curve;
}

}  // namespace xraycast
