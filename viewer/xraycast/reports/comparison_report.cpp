#include "xraycast/reports/comparison_report.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/image.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/reports/plot.hpp"
#include "xraycast/scene/canvas.hpp"
#include "xraycast/scene/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <iterator>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

constexpr int kMargin = 12, kTop = 32, kCaption = 28, kFont = 15, kMinWidth = 240, kGain = 4;
constexpr Colour kInk{0.9, 0.9, 0.9};

std::vector<std::uint8_t> difference(const std::vector<std::uint8_t>& frame,
                                     const std::vector<std::uint8_t>& drr) {
  std::vector<std::uint8_t> greys(frame.size());
  std::ranges::transform(frame, drr, greys.begin(), [](int a, int b) {
    return static_cast<std::uint8_t>(std::clamp(128 + kGain * (a - b), 0, 255));
  });
  return greys;
}

/// One channel of a picture in which all are the same.
std::vector<std::uint8_t> greys_of(const std::vector<std::uint8_t>& rgb) {
  std::vector<std::uint8_t> greys(rgb.size() / 3);
  for (std::size_t i = 0; i < greys.size(); ++i) greys[i] = rgb[3 * i];
  return greys;
}

/// The last names of a path, `count` of them, without the ending.
std::string last_names(const fs::path& path, std::ptrdiff_t count) {
  const fs::path stem = path.parent_path() / path.stem();
  fs::path names;
  for (auto part = std::next(stem.begin(),
                             std::max<std::ptrdiff_t>(0, std::distance(stem.begin(), stem.end()) - count));
       part != stem.end(); ++part)
    names /= *part;
  return names.string();
}

/// A map's name, with as many folders as tell it from the others'.
std::string distinct_name(const std::vector<ComparedMap>& maps, std::size_t number) {
  const fs::path path = maps[number].name;
  const auto all = std::distance(path.begin(), path.end());
  const auto is_shared = [&](std::ptrdiff_t count) {
    return std::ranges::count_if(maps, [&](const ComparedMap& other) {
             return other.name != maps[number].name &&
                    last_names(other.name, count) == last_names(path, count);
           }) > 0;
  };
  std::ptrdiff_t count = 1;
  while (count < all && is_shared(count)) ++count;
  return last_names(path, count);
}

std::string title_of(const CompareRequest& request, std::size_t map) {
  return fmt::format("{}, {}", distinct_name(request.maps, map), contents_of(*request.maps[map].map));
}

/// A measure that a plot shows, and the label of its axis.
struct Measure {
  const char *name, *label;
  double (*of)(const ImageSimilarity&);
};
constexpr Measure kMeasures[] = {
    {"psnr", "PSNR (dB)", [](const ImageSimilarity& similarity) { return similarity.psnr_db; }},
    {"ssim", "SSIM", [](const ImageSimilarity& similarity) { return similarity.ssim; }},
    {"rmse", "RMSE of tau (% of the largest of all views)",
     [](const ImageSimilarity& similarity) { return 100 * similarity.rmse; }}};

const Measure& measure_named(const std::string& name) {
  const Measure* const found =
      std::ranges::find(kMeasures, name, [](const Measure& measure) { return std::string(measure.name); });
  if (found == std::end(kMeasures)) throw InputError("`plot_of` {}: must be psnr, ssim or rmse", name);
  return *found;
}

}  // namespace

std::string contents_of(const BodyMap& map) {
  const MapGeometry& geometry = map.geometry;
  return pluralize(geometry.layers(), geometry.ray_layout == RayLayout::rectangle ? "picture" : "layer");
}

GreyPlate comparison_picture(const CompareRequest& request, const ComparedFrame& compared) {
  const int width = compared.view.width, height = compared.view.height;
  const GreyWindow window = automatic_window(compared.drr_tau);
  const std::vector<std::uint8_t> frame = windowed(compared.tau, window),
                                  drr = windowed(compared.drr_tau, window);
  const std::array<std::vector<std::uint8_t>, 3> pictures{frame, drr, difference(frame, drr)};
  const std::array<std::string, 3> captions{"map", "true projection", fmt::format("difference x {}", kGain)};

  const int pitch = std::max(width, kMinWidth) + kMargin;
  Canvas sheet(kMargin + 3 * pitch, kTop + height + kCaption, {0.11, 0.11, 0.11});
  sheet.text({kMargin, kTop - 10},
             fmt::format("{}, {}: PSNR {:.1f} dB, SSIM {:.3f}", title_of(request, compared.map),
                         label(compared.view), compared.similarity.psnr_db, compared.similarity.ssim),
             kFont, kInk);
  for (int i = 0; i < 3; ++i) {
    const double x = kMargin + i * pitch;
    sheet.picture(rgb_of(pictures[i]), width, height, {x, kTop, double(width), double(height)});
    sheet.text({x, kTop + height + kCaption - 9}, captions[i], kFont, kInk);
  }
  return {sheet.width(), sheet.height(), greys_of(sheet.rgb())};
}

RgbPicture comparison_plot(const std::string& scan, const std::string& measure, const CompareRequest& request,
                           const std::vector<MapComparison>& comparisons) {
  const Measure& shown = measure_named(measure);
  std::vector<Curve> curves;
  for (std::size_t i = 0; i < comparisons.size(); ++i) {
    curves.push_back({title_of(request, i), {}});
    for (std::size_t v = 0; v < request.angles_deg.size(); ++v)
      curves.back().points.emplace_back(request.angles_deg[v], shown.of(comparisons[i].views[v].covered));
  }
  return plot(fmt::format("{}, compositing {}", fs::path(scan).filename().string(),
                          to_string(request.sampling.compositing)),
              "C-arm angle (deg)", shown.label, curves);
}

}  // namespace xraycast
