#include "xraycast/evidence/voxel_shares.hpp"

#include "xraycast/base/parallel.hpp"

#include <glm/common.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace xraycast {
namespace {

/// The fractions that are told apart. Those on both sides of where lumen begins lie apart, as noise hides
/// which of two near ones it is.
constexpr std::array kFractions{0.0, 0.03,  0.1,  0.15, 0.2,  0.275, 0.35, 0.425,
                                0.5, 0.575, 0.65, 0.75, 0.85, 0.95,  1.05};
constexpr std::size_t kCount = kFractions.size();
constexpr double kTouched = 1.0 / 14;
using Distribution = std::array<double, kCount>;

/// What surrounds a voxel, the voxel itself left out.
struct Surroundings {
  float around, line;
};

/// A voxel's surroundings, for one voxel after another.
class SurroundingsOf {
 public:
  explicit SurroundingsOf(const Volume& volume) : volume_(volume), last_(volume.geometry().size - Index3(1)) {
    constexpr double kSigma_vox = 1;
    double sum = 0;
    for (std::int64_t z = -2; z <= 2; ++z)
      for (std::int64_t y = -2; y <= 2; ++y)
        for (std::int64_t x = -2; x <= 2; ++x) {
          const Index3 d(x, y, z);
          if (d == Index3(0)) continue;
          const double weight =
              std::exp(-static_cast<double>(x * x + y * y + z * z) / (2 * kSigma_vox * kSigma_vox));
          weights_[place(d)] = static_cast<float>(weight);
          sum += weight;
          const bool is_half = z > 0 || (z == 0 && (y > 0 || (y == 0 && x > 0)));
          if (is_half && glm::max(glm::max(std::abs(x), std::abs(y)), std::abs(z)) == 2)
            directions_.push_back({place(d), place(half_down(d)), place(half_up(d))});
        }
    for (float& weight : weights_) weight /= static_cast<float>(sum);
  }

  Surroundings operator()(const Index3& voxel) const {
    std::array<float, kPlaces> values;
    for (std::int64_t z = -2, i = 0; z <= 2; ++z)
      for (std::int64_t y = -2; y <= 2; ++y)
        for (std::int64_t x = -2; x <= 2; ++x, ++i) {
          const Index3 at = glm::clamp(voxel + Index3(x, y, z), Index3(0), last_);
          values[static_cast<std::size_t>(i)] = volume_.at(at.x, at.y, at.z);
        }
    Surroundings result{0, -1e9F};
    for (std::size_t i = 0; i < kPlaces; ++i) result.around += weights_[i] * values[i];
    for (const Direction& d : directions_) {
      const auto arm = [&](const auto& at) {
        return 0.5F * values[at(d.far)] + 0.25F * (values[at(d.near)] + values[at(d.other_near)]);
      };
      const float forwards = arm([](std::size_t i) { return i; }),
                  backwards = arm([](std::size_t i) { return kPlaces - 1 - i; });
      result.line = std::max(result.line, std::min(forwards, backwards));
    }
    return result;
  }

 private:
  static constexpr std::size_t kPlaces = 125;

  /// Places in a cube of five voxels, opposite ones as far from both its ends.
  struct Direction {
    std::size_t far, near, other_near;
  };

  static std::size_t place(const Index3& d) {
    return static_cast<std::size_t>((d.z + 2) * 25 + (d.y + 2) * 5 + d.x + 2);
  }
  static Index3 half_down(const Index3& d) { return {d.x / 2, d.y / 2, d.z / 2}; }
  static Index3 half_up(const Index3& d) { return d - half_down(d); }

  const Volume& volume_;
  Index3 last_;
  std::array<float, kPlaces> weights_{};
  std::vector<Direction> directions_;
};

/// How likely each level of values is for each fraction. The outermost levels hold what is cut off.
class Likelihoods {
 public:
  Likelihoods(const VoxelScale& scale, double lowest_hu, double highest_hu) : lowest_hu_(lowest_hu) {
    constexpr double kLeast = 0.02, kFine = 4;  // of the contrast; levels for each deviation
    const double deviation_hu = std::max(scale.noise_hu, kLeast * scale.lumen_hu);
    step_hu_ = std::max(1.0, std::floor(deviation_hu / kFine));
    const auto levels = static_cast<std::size_t>((highest_hu - lowest_hu) / step_hu_) + 1;
    rows_.resize(levels);
    for (std::size_t level = 0; level < levels; ++level)
      for (std::size_t f = 0; f < kCount; ++f) {
        constexpr double kUnexplained = 1e-9;
        const double mean_hu = scale.background_hu + kFractions[f] * scale.lumen_hu;
        const auto below = [&](std::size_t edge) {
          if (edge == 0) return 0.0;
          if (edge == levels) return 1.0;
          const double hu = lowest_hu_ + static_cast<double>(edge) * step_hu_ - 0.5;
          return 0.5 * std::erfc((mean_hu - hu) / (deviation_hu * std::numbers::sqrt2));
        };
        rows_[level][f] = below(level + 1) - below(level) + kUnexplained;
      }
  }

  std::size_t levels() const { return rows_.size(); }
  std::size_t level_of(double hu) const { return static_cast<std::size_t>((hu - lowest_hu_) / step_hu_); }

  /// The distribution of a voxel's fraction, given its level and the distribution before.
  Distribution posterior(std::size_t level, const Distribution& before) const {
    Distribution result;
    double sum = 0;
    for (std::size_t f = 0; f < kCount; ++f) sum += result[f] = before[f] * rows_[level][f];
    for (double& p : result) p /= sum;
    return result;
  }

 private:
  double lowest_hu_, step_hu_;
  std::vector<Distribution> rows_;
};

/// The distribution of fractions that explains how often levels occur.
Distribution explaining(const std::vector<std::int64_t>& counts, const Likelihoods& likelihoods, int passes) {
  Distribution result;
  result.fill(1.0 / kCount);
  for (int pass = 0; pass < passes; ++pass) {
    Distribution next{};
    double all = 0;
    for (std::size_t level = 0; level < counts.size(); ++level) {
      if (counts[level] == 0) continue;
      const Distribution here = likelihoods.posterior(level, result);
      const auto count = static_cast<double>(counts[level]);
      all += count;
      for (std::size_t f = 0; f < kCount; ++f) next[f] += count * here[f];
    }
    for (std::size_t f = 0; f < kCount; ++f) result[f] = next[f] / all;
  }
  return result;
}

/// Of the voxels that hold lumen, the share that it fills by less than seven tenths.
double partial_share(const Distribution& fractions) {
  constexpr double kFaint = 0.25, kPartial = 0.7;
  double with_lumen = 0, partial = 0;
  for (std::size_t f = 0; f < kCount; ++f) {
    if (kFractions[f] < kFaint) continue;
    with_lumen += fractions[f];
    if (kFractions[f] < kPartial) partial += fractions[f];
  }
  return with_lumen > 0 ? partial / with_lumen : 0;
}

/// Members in the order of a value, parted into pieces of about equal size: calls `visit(first, last)`.
template <typename Iterator, typename Value, typename Visit>
void for_each_quantile(Iterator first, Iterator last, std::int64_t pieces, const Value& value,
                       const Visit& visit) {
  std::ranges::sort(first, last, {}, value);
  const std::int64_t all = last - first;
  for (std::int64_t k = 0; k < pieces; ++k)
    if (k * all / pieces < (k + 1) * all / pieces)
      visit(first + k * all / pieces, first + (k + 1) * all / pieces);
}

}  // namespace

VoxelShares voxel_shares(const Volume& volume, const Mask& reach, const VoxelScale& scale) {
  struct Member {
    std::size_t voxel, level;
    Surroundings surroundings;
  };
  const auto [lowest, highest] = std::ranges::minmax(volume.hu());
  const Likelihoods likelihoods(scale, lowest, highest);
  std::vector<Member> members;
  for (std::size_t i = 0; i < reach.voxels.size(); ++i)
    if (reach.voxels[i] != 0) members.push_back({i, likelihoods.level_of(volume.hu()[i]), {}});
  const SurroundingsOf surroundings(volume);
  constexpr std::int64_t kPiece = 4096;
  const auto count = static_cast<std::int64_t>(members.size());
  parallel_for((count + kPiece - 1) / kPiece, [&](std::int64_t piece) {
    for (std::int64_t k = piece * kPiece; k < std::min((piece + 1) * kPiece, count); ++k) {
      Member& member = members[static_cast<std::size_t>(k)];
      member.surroundings = surroundings(voxel_at(reach.geometry, static_cast<std::int64_t>(member.voxel)));
    }
  });

  VoxelShares shares{std::vector<float>(reach.voxels.size()), std::vector<float>(reach.voxels.size())};
  std::vector<std::int64_t> all(likelihoods.levels());
  for (const Member& member : members) ++all[member.level];
  shares.partial = partial_share(explaining(all, likelihoods, 600));
  // A class of some hundred voxels tells a distribution; more classes tell more of the surroundings.
  constexpr double kOfAClass = 300;
  constexpr std::int64_t kMost = 24;
  const std::int64_t classes = std::clamp(std::llround(std::sqrt(static_cast<double>(count) / kOfAClass)),
                                          1LL, static_cast<long long>(kMost));
  const auto visit_class = [&](const auto first, const auto last) {
    std::vector<std::int64_t> counts(likelihoods.levels());
    for (auto m = first; m != last; ++m) ++counts[m->level];
    const Distribution before = explaining(counts, likelihoods, 60);
    for (auto m = first; m != last; ++m) {
      const Distribution here = likelihoods.posterior(m->level, before);
      double probability = 0, fraction = 0;
      for (std::size_t f = 0; f < kCount; ++f) {
        fraction += here[f] * std::min(kFractions[f], 1.0);
        if (kFractions[f] > kTouched) probability += here[f];
      }
      shares.probability[m->voxel] = static_cast<float>(probability);
      shares.fraction[m->voxel] = static_cast<float>(fraction);
    }
  };
  for_each_quantile(
      members.begin(), members.end(), classes, [](const Member& m) { return m.surroundings.around; },
      [&](const auto first, const auto last) {
        for_each_quantile(
            first, last, classes, [](const Member& m) { return m.surroundings.line; }, visit_class);
      });
  return shares;
}

}  // namespace xraycast
