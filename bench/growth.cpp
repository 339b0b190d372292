#include "growth.hpp"

#include "../cli/plot.hpp"
#include "xraycast/caster.hpp"
#include "xraycast/vesselness.hpp"

#include <fmt/format.h>

#include <functional>

namespace xraycast::bench {
namespace {

/// A cast of which one size is varied.
struct Growth {
  std::string size;  ///< what is varied
  std::vector<int> values;
  std::function<double(int)> ms;
};

double cast_ms(Bench& bench, const ResidentScan& scan, const MapGeometry& map, const Opacity& opacity) {
  return cast(scan, map, opacity, bench.progress).kernel_ms;
}

/// The scan's lowest slices and the map of them.
struct Part {
  ResidentScan scan;
  MapGeometry map;
};

Part lowest(Bench& bench, int slices) {
  VolumeGeometry geometry = bench.volume.geometry();
  geometry.size.z = slices;
  ResidentScan scan(bench.device, geometry);
  scan.append(bench.volume.hu().first(static_cast<std::size_t>(slices * geometry.slice_voxels())));
  const MapGeometry whole = bench.map(1);
  return {std::move(scan), cylinder_map(geometry, 360, whole.radii_mm, whole.centre_mm[0])};
}

std::vector<Growth> growths(Bench& bench) {
  return {
      {"slices",
       {90, 180, 360, 540, 720},
       [&bench](int slices) {
         const Part part = lowest(bench, slices);
         std::vector<double> times_ms;
         for (int i = 0; i < 6; ++i)
           times_ms.push_back(cast_ms(bench, part.scan, part.map, Opacity::paper()));
         return median(times_ms);
       }},
      {"angles",
       {90, 180, 360, 720, 1440},
       [&bench](int angles) { return cast_ms(bench, bench.scan, bench.map(1, angles), Opacity::paper()); }},
      {"layers",
       {1, 4, 16, 32, 64},
       [&bench](int layers) { return cast_ms(bench, bench.scan, bench.map(layers), Opacity::paper()); }},
      {"knots", {2, 4, 5, 16, 32, 64}, [&bench](int knots) {
         return cast_ms(bench, bench.scan, bench.map(1), many_knots(knots));
       }}};
}

double median_ms(const Growth& growth, int value) {
  growth.ms(value);  // at first use a driver compiles
  std::vector<double> times_ms;
  for (int i = 0; i < 7; ++i) times_ms.push_back(growth.ms(value));
  return median(times_ms);
}

}  // namespace

void measure_growth(Bench& bench, const std::filesystem::path& plot) {
  std::vector<cli::Curve> curves;
  for (const Growth& growth : growths(bench)) {
    cli::Curve curve{fmt::format("{}, {} to {}", growth.size, growth.values.front(), growth.values.back()),
                     {}};
    for (const int value : growth.values) {
      const double ms = median_ms(growth, value);
      fmt::print("{:>5} {:<7} {:>8.2f} ms\n", value, growth.size, ms);
      curve.points.emplace_back(static_cast<double>(value) / growth.values.back(), ms);
    }
    curves.push_back(std::move(curve));
  }
  cli::write_plot("Time of a cast", "share of the largest", "ms", curves, plot);
}

void measure_segmenting_growth(Bench& bench, const std::filesystem::path& plot) {
  cli::Curve curve{"vesselness at three scales", {{0, 0}}};
  for (const int size : {128, 256, 384}) {
    const Cube cube = cube_of(bench, size);
    const auto run = [&] {
      return wall_ms([&] { vesselness(cube.hu, cube.grid, VesselnessOptions{}, bench.device); });
    };
    const double megavoxels = static_cast<double>(cube.hu.size()) / 1e6;
    run();  // fills caches and pages
    const double ms = median({run(), run(), run()});
    fmt::print("{:>5}^3 voxels {:>8.0f} ms, {:.1f} ns a voxel\n", size, ms, ms / megavoxels);
    curve.points.emplace_back(megavoxels, ms / 1000);
  }
  cli::write_plot("Time of vesselness: 128, 256 and 384 voxels cubed", "million voxels", "s", {curve}, plot);
}

}  // namespace xraycast::bench
