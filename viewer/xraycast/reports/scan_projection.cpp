#include "xraycast/reports/scan_projection.hpp"

#include "xraycast/base/parallel.hpp"

#include <algorithm>
#include <cmath>

namespace xraycast {

ScanProjection project_scan(const VolumeGeometry& g, const Volume* volume,
                            std::span<const std::uint8_t> labels, std::span<const Colour> colours, int axis) {
  const int across = axis == 0 ? 1 : 0;
  const auto width = g.size[across], depth = g.size[axis];
  ScanProjection picture{axis,
                         static_cast<int>(width),
                         static_cast<int>(g.size.z),
                         static_cast<double>(width) * g.spacing_mm[across],
                         static_cast<double>(g.size.z) * g.spacing_mm.z,
                         {}};
  std::vector<float> mean(static_cast<std::size_t>(width * g.size.z)), thickness_mm(mean.size());
  std::vector<std::size_t> longest(mean.size());
  const double darkest_hu =
      volume != nullptr ? std::max<double>(-1000, *std::ranges::min_element(volume->hu())) : 0;
  parallel_for(g.size.z, [&](std::int64_t z) {
    std::vector<std::int64_t> crossed(colours.size() + 1);
    for (std::int64_t u = 0; u < width; ++u) {
      double sum = 0;
      std::ranges::fill(crossed, 0);
      for (std::int64_t v = 0; v < depth; ++v) {
        const std::int64_t x = axis == 0 ? v : u, y = axis == 0 ? u : v;
        // Values above bone are clipped, so that metal does not darken everything else.
        if (volume != nullptr) sum += std::clamp<double>(volume->at(x, y, z) - darkest_hu, 0, 2500);
        ++crossed[labels[static_cast<std::size_t>((z * g.size.y + y) * g.size.x + x)]];
      }
      const auto at = static_cast<std::size_t>((g.size.z - 1 - z) * width + u);
      mean[at] = static_cast<float>(sum / static_cast<double>(depth));
      const auto most =
          crossed[1] > 0 ? crossed.begin() + 1 : std::max_element(crossed.begin() + 1, crossed.end());
      longest[at] = static_cast<std::size_t>(most - crossed.begin() - 1);
      thickness_mm[at] = static_cast<float>(static_cast<double>(*most) * g.spacing_mm[axis]);
    }
  });
  const double lightest = std::max(1.0F, *std::ranges::max_element(mean));
  constexpr double kSolid_mm = 6;  // what is as thick or thicker has full colour
  for (std::size_t i = 0; i < mean.size(); ++i) {
    const double grey = 0.85 * mean[i] / lightest, mm = thickness_mm[i],
                 share = mm > 0 ? 0.35 + 0.4 * std::min(1.0, mm / kSolid_mm) : 0;
    const Colour& colour = colours[longest[i]];
    for (const double component : {colour.red, colour.green, colour.blue})
      picture.rgb.push_back(
          static_cast<std::uint8_t>(std::lround(255 * (grey + share * (component - grey)))));
  }
  return picture;
}

PixelBox draw_projection(Canvas& sheet, const ScanProjection& picture, const PixelBox& box) {
  const double pixels_per_mm = std::min(box.width / picture.width_mm, box.height / picture.height_mm);
  const double width = std::max(1.0, std::floor(picture.width_mm * pixels_per_mm)),
               height = std::max(1.0, std::floor(picture.height_mm * pixels_per_mm));
  const PixelBox filled{box.left + std::floor(0.5 * (box.width - width)),
                        box.top + std::floor(0.5 * (box.height - height)), width, height};
  sheet.picture(picture.rgb, picture.width, picture.height, filled);
  return filled;
}

}  // namespace xraycast
