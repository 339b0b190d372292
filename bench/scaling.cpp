#include "scaling.hpp"

#include "frames.hpp"
#include "simulating.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/casting/caster.hpp"
#include "xraycast/reports/plot.hpp"
#include "xraycast/segmentation/vesselness.hpp"

#include <fmt/format.h>

#include <functional>

namespace xraycast::bench {
namespace {

/// A cast of which one size is varied.
struct Scaling {
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

std::vector<Scaling> scalings(Bench& bench) {
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

double median_ms(const Scaling& scaling, int value) {
  scaling.ms(value);  // at first use a driver compiles
  std::vector<double> times_ms;
  for (int i = 0; i < 7; ++i) times_ms.push_back(scaling.ms(value));
  return median(times_ms);
}

}  // namespace

void measure_drawing_scaling(Bench& bench, const std::filesystem::path& plot) {
  const auto frame_ms = [&](int layers, int width, int height) {
    Frames frames(bench.scan, bench.map(layers), width, height, false);
    std::vector<double> times_ms;
    for (int i = 0; i < 25; ++i) times_ms.push_back(frames.next_ms());
    return median(times_ms);
  };
  Curve over_layers{"1 to 64 layers, 640 x 480 pixels", {}},
      over_pixels{"8 layers, 320 x 240 to 1920 x 1440", {}};
  for (const int layers : {1, 2, 4, 8, 16, 32, 64}) {
    const double ms = frame_ms(layers, 640, 480);
    fmt::print("{:>5} {:<7} {:>8.2f} ms\n", layers, "layers", ms);
    over_layers.points.emplace_back(layers / 64.0, ms);
  }
  for (const int side : {1, 2, 3, 4, 5, 6}) {
    const double ms = frame_ms(8, 320 * side, 240 * side);
    fmt::print("{:>5} x {:<4} pixels {:>8.2f} ms\n", 320 * side, 240 * side, ms);
    over_pixels.points.emplace_back(side * side / 36.0, ms);
  }
  write_picture(xraycast::plot("Time of a frame", "share of the largest", "ms", {over_layers, over_pixels}),
                plot);
}

void measure_rod_scaling(const std::filesystem::path& plot) {
  // One spacing for all, so that only the number of nodes changes.
  constexpr double kSpacing_mm = 1.2;
  Curve curve{"50 to 800 nodes", {}};
  for (const std::size_t nodes : {50, 100, 200, 400, 800}) {
    InstrumentSteps steps(1, nodes, kSpacing_mm);
    std::vector<double> times_ms;
    for (int i = 0; i < 1000; ++i) times_ms.push_back(steps.next_ms());
    const double ms = median(times_ms);
    fmt::print("{:>5} {:<7} {:>8.3f} ms\n", nodes, "nodes", ms);
    curve.points.emplace_back(static_cast<double>(nodes), ms);
  }
  write_picture(xraycast::plot("Time of a step of the catheter", "nodes", "ms", {curve}), plot);
}

void measure_scaling(Bench& bench, const std::filesystem::path& plot) {
  std::vector<Curve> curves;
  for (const Scaling& scaling : scalings(bench)) {
    Curve curve{fmt::format("{}, {} to {}", scaling.size, scaling.values.front(), scaling.values.back()), {}};
    for (const int value : scaling.values) {
      const double ms = median_ms(scaling, value);
      fmt::print("{:>5} {:<7} {:>8.2f} ms\n", value, scaling.size, ms);
      curve.points.emplace_back(static_cast<double>(value) / scaling.values.back(), ms);
    }
    curves.push_back(std::move(curve));
  }
  write_picture(xraycast::plot("Time of a cast", "share of the largest", "ms", curves), plot);
}

void measure_segmenting_scaling(Bench& bench, const std::filesystem::path& plot) {
  Curve curve{"vesselness at three scales", {{0, 0}}};
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
  write_picture(
      xraycast::plot("Time of vesselness: 128, 256 and 384 voxels cubed", "million voxels", "s", {curve}),
      plot);
}

}  // namespace xraycast::bench
