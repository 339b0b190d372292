// Segmenting: the whole way from a scan to its vessels' tree and surface, and vesselness against ITK's.
#include "baselines.hpp"
#include "suite.hpp"
#include "xraycast/segmentation/vesselness.hpp"
#include "xraycast/segmentation/vessels.hpp"

#include <algorithm>
#include <memory>

namespace xraycast::bench {
namespace {

void segment(Bench& bench) {
  benchmark::DoNotOptimize(find_vessels(bench.volume, {}, "thorax", bench.device, bench.progress));
}

}  // namespace

Cube cube_of(const Bench& bench, std::int64_t size) {
  const VolumeGeometry& g = bench.volume.geometry();
  Cube cube{{.size = Index3(size), .spacing_mm = g.spacing_mm, .origin_mm = {0, 0, 0}}, {}};
  const Index3 lower = (g.size - cube.grid.size) / Index3(2);
  for (std::int64_t z = 0; z < size; ++z)
    for (std::int64_t y = 0; y < size; ++y)
      for (std::int64_t x = 0; x < size; ++x)
        cube.hu.push_back(bench.volume.at(lower.x + x, lower.y + y, lower.z + z));
  return cube;
}

std::vector<Row> add_segmenting(Bench& bench) {
  const auto cube = std::make_shared<Cube>(cube_of(bench, 256));
  add("segment_720", [&bench] { segment(bench); });
  add("vesselness_256", [&bench, cube] {
    benchmark::DoNotOptimize(vesselness(cube->hu, cube->grid, VesselnessOptions{}, bench.device).data());
  });
  add("ITK objectness", [cube] { vesselness_by_itk(*cube, VesselnessOptions{}.scales_mm); });
  using enum Row::Bar;
  return {{"segment_720", "40 s", at_most, 1}, {"vesselness_256", "ITK objectness", at_least, 4}};
}

}  // namespace xraycast::bench
