#include "xraycast/radii/lumen_brightness.hpp"

#include "xraycast/base/parallel.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>

namespace xraycast {
namespace {

struct Weighted {
  double value, weight;
};

double median(std::vector<Weighted> values) {
  std::ranges::sort(values, {}, &Weighted::value);
  double all = 0, sum = 0;
  for (const Weighted& w : values) all += w.weight;
  for (const Weighted& w : values)
    if ((sum += w.weight) >= 0.5 * all) return w.value;
  return values.back().value;
}

/// Of values with weights, the median and the spread about it, at least a share of the contrasts' median.
std::optional<UsualLumen> usual_lumen(const std::vector<FoundLumen>& lumens) {
  constexpr double kLeastSpread = 0.08, kOfMedian = 1.5;
  std::vector<Weighted> values, contrasts;
  for (const FoundLumen& found : lumens) {
    if (!(found.deviation_hu > 0) || !(found.contrast_hu > 0)) continue;
    const double weight = std::pow(found.contrast_hu / found.deviation_hu, 2);
    values.push_back({found.hu, weight});
    contrasts.push_back({found.contrast_hu, weight});
  }
  if (values.empty()) return std::nullopt;
  const double usual_hu = median(values);
  for (Weighted& value : values) value.value = std::abs(value.value - usual_hu);
  return UsualLumen{usual_hu, std::max(kOfMedian * median(values), kLeastSpread * median(contrasts))};
}

/// What a blur makes of a stretch.
struct Explained {
  double cost = 0;  ///< the residuals' logarithm for each sample
  FoundLumen lumen;
};

constexpr std::size_t kBlurs = 16;
using OfBlurs = std::array<Explained, kBlurs>;

/// How badly a blur explains all stretches: the residuals, and lumens that differ. Of a thin vessel a smaller
/// blur makes a wider and darker one, which its own samples hardly contradict.
double cost_of(std::size_t blur, const std::vector<OfBlurs>& stretches) {
  constexpr double kMostOdds = 4.5;  // for a vessel that is of another brightness
  std::vector<FoundLumen> lumens;
  double cost = 0;
  for (const OfBlurs& stretch : stretches) {
    lumens.push_back(stretch[blur].lumen);
    cost += stretch[blur].cost;
  }
  const auto usual = usual_lumen(lumens);
  if (!usual) return cost;
  for (const FoundLumen& lumen : lumens)
    if (lumen.deviation_hu > 0)
      cost += std::min(
          0.5 * std::pow((lumen.hu - usual->hu) / std::hypot(lumen.deviation_hu, usual->spread_hu), 2),
          kMostOdds);
  return cost;
}

/// Stretches that tell the blur: the widest ones, which tell most, and of the others as many.
std::vector<std::size_t> telling(const std::vector<Stretch>& stretches) {
  constexpr std::size_t kWide = 40, kOthers = 40;
  std::vector<std::size_t> order(stretches.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, std::greater(), [&](std::size_t i) { return stretches[i].given_mm; });
  std::vector<std::size_t> result;
  const std::size_t every = order.size() > kWide ? (order.size() - kWide) / kOthers + 1 : 1;
  for (std::size_t i = 0; i < order.size(); i += i < kWide ? 1 : every) result.push_back(order[i]);
  return result;
}

class Brightness {
 public:
  Brightness(const TubeQuestions& tubes, const std::vector<Stretch>& stretches)
      : tubes_(tubes), stretches_(stretches) {}

  /// Nothing where it is more than can be told.
  std::optional<double> blur_mm() const {
    constexpr double kUsual = 4, kSpread = 4;  // steps
    const std::vector<std::size_t> asked = telling(stretches_);
    std::vector<OfBlurs> explained(asked.size());
    parallel_for(std::ssize(explained), [&](std::int64_t i) {
      const auto at = static_cast<std::size_t>(i);
      explained[at] = explained_by_each(stretches_[asked[at]]);
    });
    std::array<double, kBlurs> costs{};
    for (std::size_t k = 0; k < kBlurs; ++k)
      costs[k] = cost_of(k, explained) + 0.5 * std::pow((static_cast<double>(k) - kUsual) / kSpread, 2);
    const auto best = static_cast<std::size_t>(std::ranges::min_element(costs) - costs.begin());
    if (best + 1 == kBlurs) return std::nullopt;
    double step = static_cast<double>(best);
    if (best > 0) {
      const double a = costs[best - 1], b = costs[best], c = costs[best + 1];
      if (a - 2 * b + c > 0) step += 0.5 * (a - c) / (a - 2 * b + c);
    }
    return blur_of_step_mm(step);
  }

  std::vector<FoundLumen> lumens(double blur_mm) const {
    std::vector<FoundLumen> found(stretches_.size());
    parallel_for(std::ssize(found), [&](std::int64_t i) {
      const auto at = static_cast<std::size_t>(i);
      const Stretch& stretch = stretches_[at];
      const std::vector<SampleAcross> samples = stretch.samples();
      const auto guessed = tubes_.guess(samples, stretch.given_mm);
      if (!guessed) return;
      if (const auto answer = fit(stretch, samples, *guessed, blur_mm))
        found[at] = lumen_of(*answer, blur_mm);
    });
    return found;
  }

 private:
  /// Blurs from none to two voxels: a tenth of a voxel apart up to one, farther beyond.
  double blur_of_step_mm(double step) const {
    constexpr double kStep_vox = 0.1, kFine = 10, kGrowth = 1.15;
    return tubes_.voxel_mm() *
           (step <= kFine ? kStep_vox * step : kStep_vox * kFine * std::pow(kGrowth, step - kFine));
  }

  std::optional<TubeAnswer> fit(const Stretch& stretch, std::span<const SampleAcross> samples,
                                const GuessedTube& guessed, double blur_mm) const {
    constexpr double kMostTaper = 0.05;
    TubeQuestion q = tubes_.question(guessed, tubes_.across_mm(blur_mm, stretch.tangent), stretch.given_mm);
    q.taper = {0, kMostTaper};
    return fit_tube(samples, q);
  }

  OfBlurs explained_by_each(const Stretch& stretch) const {
    constexpr double kEven = 0.02, kRounding_hu = 0.3;
    const std::vector<SampleAcross> samples = stretch.samples();
    const auto guessed = tubes_.guess(samples, stretch.given_mm);
    if (!guessed) return {};
    const double floor_hu = std::max(kEven * guessed->contrast_hu(), kRounding_hu);
    OfBlurs result;
    for (std::size_t k = 0; k < kBlurs; ++k) {
      const double blur_mm = blur_of_step_mm(static_cast<double>(k));
      const auto found = fit(stretch, samples, *guessed, blur_mm);
      if (!found) return {};
      result[k] = {found->samples * std::log(std::hypot(found->rms_of_all_hu, floor_hu)),
                   lumen_of(*found, blur_mm)};
    }
    return result;
  }

  FoundLumen lumen_of(const TubeAnswer& found, double blur_mm) const {
    // A line that is off the middle makes a vessel wider and darker, the more
    // the thinner it is.
    constexpr double kUneven = 0.05, kWobble_vox2 = 0.06, kOfBlur = 0.4;
    const double blur_vox = blur_mm / tubes_.voxel_mm(),
                 radius_vox = found.tube.radius_mm / tubes_.voxel_mm(),
                 wobble_vox2 = kWobble_vox2 + kOfBlur * blur_vox * blur_vox,
                 wobble = 4 * wobble_vox2 / (radius_vox * radius_vox + 4 * wobble_vox2),
                 contrast_hu = std::max(found.tube.contrast_hu(), 0.0);
    return {
        found.tube.lumen_hu, contrast_hu,
        std::hypot(found.lumen_deviation_hu * tubes_.misfit(found), std::max(kUneven, wobble) * contrast_hu)};
  }

  const TubeQuestions& tubes_;
  const std::vector<Stretch>& stretches_;
};

}  // namespace

Known LumenBrightness::on(std::size_t stretch) const {
  constexpr double kOther = 3;  // deviations
  const double of_usual = 1 / (usual.spread_hu * usual.spread_hu);
  const auto [hu, contrast_hu, deviation_hu] = of_stretches[stretch];
  if (!(deviation_hu > 0)) return {usual.hu, usual.spread_hu};
  if (std::abs(hu - usual.hu) > kOther * std::hypot(deviation_hu, usual.spread_hu)) return {hu, deviation_hu};
  const double own = 1 / (deviation_hu * deviation_hu);
  return {(of_usual * usual.hu + own * hu) / (of_usual + own), 1 / std::sqrt(of_usual + own)};
}

std::optional<LumenBrightness> measure_brightness(const TubeQuestions& tubes,
                                                  const std::vector<Stretch>& stretches) {
  const Brightness brightness(tubes, stretches);
  const auto blur_mm = brightness.blur_mm();
  if (!blur_mm) return std::nullopt;
  std::vector<FoundLumen> lumens = brightness.lumens(*blur_mm);
  const auto usual = usual_lumen(lumens);
  if (!usual) return std::nullopt;
  return LumenBrightness{*blur_mm, *usual, std::move(lumens)};
}

}  // namespace xraycast
