#include "xraycast/viewer/map_texels.hpp"

#include "xraycast/parallel.hpp"

#include <algorithm>

namespace xraycast {

MapTexels map_texels(const MapGeometry& geometry, std::span<const float> values, const SampleOptions& options,
                     std::span<const float> strengths) {
  const auto width = static_cast<std::size_t>(geometry.width),
             height = static_cast<std::size_t>(geometry.height);
  const auto layers = static_cast<std::size_t>(geometry.layers());
  MapTexels texels{geometry.width + 1, (geometry.height + 3) / 4, {}};
  const std::size_t run = 4 * static_cast<std::size_t>(texels.quads);
  texels.values.resize(layers * (width + 1) * run);
  const bool solves =
      geometry.projection != Projection::rectangle && options.compositing == Compositing::path;
  const RadialProfile profile(geometry.radii_mm, options.reconstruction);
  const auto system_of_row = [&](int row) {
    std::vector<double> reaches_mm;
    for (int i = 0; i < geometry.width; ++i) reaches_mm.push_back(geometry.reach_mm(i, row));
    return profile.system(reaches_mm);
  };
  // About a straight axis all rows are alike.
  const bool is_alike = geometry.projection == Projection::cylinder && geometry.centre_mm.size() == 1;
  const RadialProfile::System common = solves && is_alike ? system_of_row(0) : RadialProfile::System();

  // Blocks of rows that fit the cache: each is solved along the layers, then transposed.
  constexpr std::size_t kRows = 16;
  parallel_for(static_cast<std::int64_t>((height + kRows - 1) / kRows), [&](std::int64_t block) {
    const std::size_t first = static_cast<std::size_t>(block) * kRows, rows = std::min(kRows, height - first);
    std::vector<float> solved(layers * rows * width);
    for (std::size_t k = 0; k < layers; ++k)
      std::copy_n(&values[(k * height + first) * width], rows * width, &solved[k * rows * width]);
    for (std::size_t j = 0; solves && j < rows; ++j) {
      const std::span<float> row = std::span(solved).subspan(j * width);
      if (is_alike)
        common.solve(row, rows * width);
      else
        system_of_row(static_cast<int>(first + j)).solve(row, rows * width);
    }
    for (std::size_t k = 0; k < layers; ++k) {
      const float strength = strengths.empty() ? 1.0f : strengths[k];
      for (std::size_t i = 0; i <= width; ++i) {
        float* to = &texels.values[(k * (width + 1) + i) * run + first];
        const float* from = &solved[k * rows * width + i % width];
        for (std::size_t j = 0; j < rows; ++j) to[j] = strength * from[j * width];
      }
    }
  });
  return texels;
}

}  // namespace xraycast
