// Every benchmark with its yardstick in the same run, repeated and interleaved at random, so that their ratio
// survives a machine whose speed drifts. What is held constant: the thorax phantom of 512 x 512 x 720 voxels,
// 360 angles, a radius of 255 pixels about the middle, all cores.
#include "rtk.hpp"
#include "table.hpp"
#include "xraycast/caster.hpp"
#include "xraycast/phantom.hpp"
#include "xraycast/projector.hpp"
#include "xraycast/scan.hpp"
#include "yardsticks.hpp"

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <numbers>
#include <stdexcept>

namespace xraycast::bench {
namespace {

namespace fs = std::filesystem;

/// Keeps the median of every benchmark's repetitions, and prints as the console does.
class Collector final : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs)
      if (run.run_type == Run::RT_Aggregate && run.aggregate_name == "median" && !run.error_occurred)
        keep(run);
  }
  Times times;

 private:
  void keep(const Run& run) {
    times[run.run_name.function_name] = run.GetAdjustedRealTime();
    // A yardstick that was measured by turns with its value.
    const auto rtk = run.counters.find("rtk_ms");
    if (rtk != run.counters.end()) times["RTK, " + run.run_name.function_name] = rtk->second.value;
  }
};

/// What all benchmarks share, made once.
struct Bench {
  Device device;
  Progress progress;
  Volume volume;
  ResidentScan scan;
  fs::path file;                      ///< the scan as an uncompressed NRRD
  std::unique_ptr<RtkProjector> rtk;  ///< none when it cannot be had

  Bench(fs::path folder, const fs::path& python)
      : volume(generate(make_phantom("thorax"), device, progress)),
        scan(upload(device, volume)),
        file(std::move(folder) / "bench-thorax.nrrd") {
    write_volume(volume, file, progress);
    try {
      rtk = std::make_unique<RtkProjector>(python, file);
    } catch (const std::runtime_error& error) {
      fmt::print(stderr, "No yardstick for the projections, since RTK cannot be had: {}\n", error.what());
    }
  }

  MapGeometry map(int layers) const {
    const VolumeGeometry& g = volume.geometry();
    const glm::dvec3 middle = g.to_world_mm(0.5 * glm::dvec3(g.size - Index3(1)));
    return cylinder_map(g, 360, shell_radii_mm(RadiiRule::equal_area, layers, 255 * g.spacing_mm.x),
                        glm::dvec2(middle));
  }
};

Opacity many_knots(int count) {
  std::vector<Opacity::Knot> knots;
  for (int i = 0; i < count; ++i)
    knots.push_back({-1000.0 + 2500.0 / count * i, 0.0005 * i * (1 + 0.2 * (i % 3))});
  return {fmt::format("{} knots", count), knots};
}

/// Registers `work`, timed by the wall, or by what it returns in milliseconds.
template <typename Work>
void add(const std::string& name, Work work) {
  auto* registered = benchmark::RegisterBenchmark(name.c_str(), [work](benchmark::State& state) {
    for (auto _ : state) {
      if constexpr (std::is_void_v<decltype(work())>) {
        const auto start = std::chrono::steady_clock::now();
        work();
        state.SetIterationTime(
            std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
      } else {
        state.SetIterationTime(work() / 1000);
      }
    }
  });
  registered->UseManualTime()->Unit(benchmark::kMillisecond);
}

double kernel_ms(Bench& bench, int layers, const Opacity& opacity) {
  return cast(bench.scan, bench.map(layers), opacity, bench.progress).kernel_ms;
}

void cast_from_file(Bench& bench) {
  const Scan scan = open_scan(bench.file, {}, bench.progress);
  OutlineFinder finder(scan.source->geometry());
  LoadTimings timings;
  const ResidentScan resident = load(bench.device, *scan.source, finder, timings, bench.progress);
  write_body_map(cast(resident, bench.map(1), Opacity::paper(), bench.progress).map,
                 fs::path(bench.file).replace_extension(".exr"));
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// Wall time of `work` in milliseconds.
template <typename Work>
double wall_ms(const Work& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

/// Registers a picture under a cone, from the opacity in the host's memory to the picture there: median over
/// five angles, ours and RTK's by turns.
void add_projection(Bench& bench, const std::string& name, double tilt_deg, const Opacity& opacity) {
  const auto run = [&bench, tilt_deg, opacity](benchmark::State& state) {
    constexpr double kRadians = std::numbers::pi / 180;
    const bool is_rtk_opacity = opacity.name() == Opacity::paper().name();
    for (auto _ : state) {
      std::vector<double> ours_ms, rtk_ms;
      for (const double angle_deg : {0.0, 30.0, 45.0, 90.0, 200.0}) {
        const View view{.angle_rad = angle_deg * kRadians,
                        .tilt_rad = tilt_deg * kRadians,
                        .cone = Cone{1000, 1500},
                        .width = 640,
                        .height = 480,
                        .pixel_mm = 0.9};
        ProjectionImage image;
        // At first use a driver compiles.
        if (ours_ms.empty()) image = project(bench.scan, view, opacity, bench.progress);
        ours_ms.push_back(wall_ms([&] { image = project(bench.scan, view, opacity, bench.progress); }));
        if (!bench.rtk) continue;
        const auto [ms, tau] = bench.rtk->project(view);
        rtk_ms.push_back(ms);
        // Both are Joseph's method in single precision; more than 100 dB are seen.
        if (is_rtk_opacity && !(psnr_db(image.tau, tau) > 80))
          state.SkipWithError("RTK's picture is another one, and no yardstick");
      }
      state.SetIterationTime(median(ours_ms) / 1000);
      if (bench.rtk) state.counters["rtk_ms"] = median(rtk_ms);
    }
  };
  benchmark::RegisterBenchmark(name.c_str(), run)
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond)
      ->Iterations(1);
}

void register_all(Bench& bench) {
  // The samples of a cast: 255 steps, 360 angles, 45 bricks of 16 slices.
  constexpr std::int64_t kSamples = std::int64_t{255} * 360 * 45;
  add("all-core read", [&bench] { read_all(bench.volume); });
  add("samples from cache", [] { sample_from_cache(kSamples); });
  add("file read", [&bench] { read_file(bench.file); });
  add("OpenCV warpPolar", [&bench] { map_by_opencv(bench.volume, 255); });
  for (const int layers : {1, 8, 16})
    add(fmt::format("cast_resident_{}", layers),
        [&bench, layers] { return kernel_ms(bench, layers, Opacity::paper()); });
  add("cast_64knots_1", [&bench] { return kernel_ms(bench, 1, many_knots(64)); });
  add("cast_from_file_1", [&bench] { cast_from_file(bench); });
  add_projection(bench, "project_640x480", 0, Opacity::paper());
  add_projection(bench, "project_640x480_tilt", 20, Opacity::paper());
  add_projection(bench, "project_640x480_64knots", 0, many_knots(64));
  add("phantom_720", [&bench] { generate(make_phantom("thorax"), bench.device, bench.progress); });
  const fs::path chest = fs::path(XRAYCAST_TEST_DATA) / "chest-dicom";
  if (!fs::exists(chest)) return;
  add("ITK series reader", [chest] { read_series_by_itk(chest); });
  add("read_dicom_275", [chest, &bench] {
    const Scan scan = open_scan(chest, {}, bench.progress);
    benchmark::DoNotOptimize(collect(*scan.source, bench.progress).hu().data());
  });
}

std::vector<Row> rows() {
  using enum Row::Bar;
  return {{"cast_resident_1", "floor", at_most, 2},
          {"cast_resident_16", "floor", at_most, 2},
          {"cast_resident_8", "floor", reported, 0},
          {"cast_64knots_1", "floor", reported, 0},
          {"cast_from_file_1", "file read", at_most, 2},
          {"read_dicom_275", "ITK series reader", at_least, 1.6},
          {"cast_vs_opencv", "OpenCV warpPolar", at_least, 10},
          {"project_640x480", "RTK, project_640x480", at_least, 10},
          {"project_640x480_tilt", "RTK, project_640x480_tilt", at_least, 6},
          {"project_640x480_64knots", "RTK, project_640x480_64knots", at_least, 3},
          {"phantom_720", "all-core read", reported, 0}};
}

}  // namespace
}  // namespace xraycast::bench

int main(int argc, char** argv) {
  using namespace xraycast::bench;
  benchmark::Initialize(&argc, argv);
  const fs::path folder = argc > 1 ? argv[1] : ".";
  Bench bench(folder, argc > 2 ? argv[2] : "python3");
  register_all(bench);
  Collector collector;
  benchmark::RunSpecifiedBenchmarks(&collector);
  Times& times = collector.times;
  // The floor of a cast is the slower of reading the bytes and taking the samples.
  if (times.contains("all-core read") && times.contains("samples from cache"))
    times["floor"] = std::max(times["all-core read"], times["samples from cache"]);
  if (times.contains("cast_resident_1")) times["cast_vs_opencv"] = times["cast_resident_1"];
  print_table(rows(), times);
  write_json(rows(), times, (folder / "bench.json").string());
  fs::remove(bench.file);
  return 0;
}
