#pragma once

#include "baselines.hpp"
#include "table.hpp"
#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/casting/map_geometry.hpp"
#include "xraycast/casting/spectral_scan.hpp"
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/motion/key_phases.hpp"
#include "xraycast/projection/view.hpp"

#include <benchmark/benchmark.h>

#include <filesystem>
#include <string>
#include <type_traits>
#include <vector>

namespace xraycast::bench {

/// Shared by the benchmarks, made once: the thorax phantom of 512 x 512 x 720 voxels, and an OpenGL context.
struct Bench {
  HeadlessContext context;
  ComputeDevice device;
  Progress progress;
  Volume volume;
  SpectralScan whole;
  const ResidentScan& scan;  ///< of `whole`
  OutlineFinder body;
  std::filesystem::path file;    ///< the scan as an uncompressed NRRD
  std::filesystem::path python;  ///< an interpreter that may find RTK

  /// Writes the scan's file into `folder`.
  Bench(std::filesystem::path folder, std::filesystem::path python);

  /// A map about the middle, of a radius of 255 pixels, in circles.
  MapGeometry map(int layers, int angles = 360) const;

  /// The same in shells that follow the body.
  MapGeometry body_map(int layers) const;

  /// How it breathes, with a beating heart, and the usual key phases of that.
  Motion motion;
  KeyPhases keys;

  /// Of the same radius: parallel pictures from that many angles.
  MapGeometry pictures(int views) const;
};

/// An opacity with `count` knots.
Opacity many_knots(int count);

/// A C-arm's picture of 640 x 480 pixels with a cone beam.
View c_arm(double angle_deg, double tilt_deg);

double median(std::vector<double> values);

/// Wall time of `work` in milliseconds.
template <typename Work>
double wall_ms(Work&& work) {
  const Stopwatch stopwatch;
  work();
  return stopwatch.ms();
}

/// Registers `work`, timed by the wall, or by what it returns in milliseconds; and by all threads' processor
/// time.
template <typename Work>
benchmark::internal::Benchmark* add(const std::string& name, Work work) {
  auto* registered = benchmark::RegisterBenchmark(name.c_str(), [work](benchmark::State& state) mutable {
    for (auto _ : state) {
      if constexpr (std::is_void_v<decltype(work())>)
        state.SetIterationTime(wall_ms(work) / 1000);
      else
        state.SetIterationTime(work() / 1000);
    }
  });
  return registered->UseManualTime()->MeasureProcessCPUTime()->Unit(benchmark::kMillisecond);
}

/// A cube from the middle of the scan.
Cube cube_of(const Bench& bench, std::int64_t size);

// One topic per file: each registers its benchmarks and baselines and returns its lines of the table.
std::vector<Row> add_casting(Bench& bench);
std::vector<Row> add_projecting(Bench& bench);
std::vector<Row> add_drawing(Bench& bench);
std::vector<Row> add_simulating(Bench& bench);
std::vector<Row> add_segmenting(Bench& bench);
std::vector<Row> add_registering(Bench& bench);

}  // namespace xraycast::bench
