// Every benchmark with its yardstick in the same run, repeated and interleaved at random, so that their ratio
// survives a machine whose speed drifts. What is held constant: the thorax phantom of 512 x 512 x 720 voxels,
// 360 angles, a radius of 255 pixels about the middle, all cores.
#include "frames.hpp"
#include "rtk.hpp"
#include "table.hpp"
#include "xraycast/caster.hpp"
#include "xraycast/phantom.hpp"
#include "xraycast/projector.hpp"
#include "xraycast/recast.hpp"
#include "xraycast/scan.hpp"
#include "xraycast/slab_caster.hpp"
#include "xraycast/stopwatch.hpp"
#include "xraycast/viewer/headless_context.hpp"
#include "yardsticks.hpp"

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <tuple>

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
  HeadlessContext context;
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
  auto* registered = benchmark::RegisterBenchmark(name.c_str(), [work](benchmark::State& state) mutable {
    for (auto _ : state) {
      if constexpr (std::is_void_v<decltype(work())>) {
        const Stopwatch stopwatch;
        work();
        state.SetIterationTime(stopwatch.ms() / 1000);
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
  const std::int64_t slab = slab_slices_within(scan.source->geometry(), bench.device.info().max_allocation_B);
  const CastResult result =
      cast_by_slabs(bench.device, *scan.source, bench.map(1), Opacity::paper(), slab, bench.progress);
  write_body_map(result.map, fs::path(bench.file).replace_extension(".exr"));
}

/// A session over `layers` layers on the knots of `opacity`.
std::shared_ptr<RecastSession> recast_session(Bench& bench, int layers, const Opacity& opacity) {
  std::vector<double> knots_hu;
  for (const Opacity::Knot& knot : opacity.knots()) knots_hu.push_back(knot.hu);
  return std::make_shared<RecastSession>(bench.device,
                                         make_basis(bench.scan, bench.map(layers), knots_hu, bench.progress));
}

/// Recasts under another opacity at every call.
void add_recast(Bench& bench, const std::string& name, int layers, int knots) {
  const Opacity opacity = many_knots(knots);
  const auto session = recast_session(bench, layers, opacity);
  std::vector<Opacity::Knot> brighter(opacity.knots().begin(), opacity.knots().end());
  for (Opacity::Knot& knot : brighter) knot.mu_per_mm *= 1.5;
  const std::array opacities{opacity, Opacity("brighter", brighter)};
  add(name, [session, opacities, next = 0]() mutable { session->recast(opacities[next ^= 1]); });
}

void add_knot_move(Bench& bench, const std::string& name, int layers, int knots) {
  const auto session = recast_session(bench, layers, many_knots(knots));
  session->recast(many_knots(knots));
  add(name, [session, moves = 0]() mutable { session->set_knot(13, 0.01 + 0.001 * (++moves % 10)); });
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// Wall time of `work` in milliseconds.
template <typename Work>
double wall_ms(const Work& work) {
  const Stopwatch stopwatch;
  work();
  return stopwatch.ms();
}

/// A C-arm's picture of 640 x 480 pixels.
View c_arm(double angle_deg, double tilt_deg) {
  constexpr double kRadians = std::numbers::pi / 180;
  return {.angle_rad = angle_deg * kRadians,
          .tilt_rad = tilt_deg * kRadians,
          .cone = Cone{1000, 1500},
          .width = 640,
          .height = 480,
          .pixel_mm = 0.9};
}

/// Registers a picture under a cone, from the opacity in the host's memory to the picture there: median over
/// five angles, ours and RTK's by turns.
void add_projection(Bench& bench, const std::string& name, double tilt_deg, const Opacity& opacity) {
  const auto run = [&bench, tilt_deg, opacity](benchmark::State& state) {
    const bool is_rtk_opacity = opacity.name() == Opacity::paper().name();
    for (auto _ : state) {
      std::vector<double> ours_ms, rtk_ms;
      for (const double angle_deg : {0.0, 30.0, 45.0, 90.0, 200.0}) {
        const View view = c_arm(angle_deg, tilt_deg);
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
  add_recast(bench, "recast_1", 1, 64);
  add_recast(bench, "recast_8", 8, 32);
  add_knot_move(bench, "recast_knot_8", 8, 32);
  add("cast_from_file_1", [&bench] { cast_from_file(bench); });
  add_projection(bench, "project_640x480", 0, Opacity::paper());
  add_projection(bench, "project_640x480_tilt", 20, Opacity::paper());
  add_projection(bench, "project_640x480_64knots", 0, many_knots(64));
  add("phantom_720", [&bench] { generate(make_phantom("thorax"), bench.device, bench.progress); });
  add("paper's 16 frames/s", [] { return 1000.0 / 16; });
  // The paper's own scene, one layer drawn as a wall around vessels, and what has become of it since.
  using enum Compositing;
  for (const auto& [name, layers, width, height, with_vessels, compositing] :
       {std::tuple{"frame_1_1280", 1, 1280, 720, true, wall},
        std::tuple{"frame_1_path_1280", 1, 1280, 720, true, path},
        std::tuple{"frame_8_1280", 8, 1280, 720, false, path},
        std::tuple{"frame_8_vessels_1280", 8, 1280, 720, true, path},
        std::tuple{"frame_8_640", 8, 640, 480, false, path}}) {
    auto frames =
        std::make_shared<Frames>(bench.scan, bench.map(layers), width, height, with_vessels, compositing);
    add(name, [frames] { return frames->next_ms(); });
  }
  auto recast = std::make_shared<OpacityFrames>(bench.scan, bench.map(8), 640, 480);
  add("opacity_to_frame_8_640", [recast] { return recast->next_ms(); });
  add("frame_true_640", [&bench, angle_deg = 0.0]() mutable {
    const View view = c_arm(angle_deg += 5, 0);
    return wall_ms([&] { project(bench.scan, view, Opacity::paper(), bench.progress); });
  });
  if (auto vtk = std::make_shared<VtkRayCaster>(bench.file, 640, 480); vtk->is_there()) {
    add("VTK frame", [vtk] { return vtk->frame_ms(); });
    add("VTK opacity to frame", [vtk] { return vtk->opacity_ms(); });
  }
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
          {"recast_1", "cast_resident_1", at_most, 0.08},
          {"recast_8", "cast_resident_8", at_most, 0.3},
          {"recast_knot_8", "cast_resident_8", at_most, 0.1},
          {"read_dicom_275", "ITK series reader", at_least, 1.6},
          {"cast_vs_opencv", "OpenCV warpPolar", at_least, 10},
          {"project_640x480", "RTK, project_640x480", at_least, 10},
          {"project_640x480_tilt", "RTK, project_640x480_tilt", at_least, 6},
          {"project_640x480_64knots", "RTK, project_640x480_64knots", at_least, 3},
          {"frame_1_1280", "paper's 16 frames/s", at_least, 3},
          {"frame_1_path_1280", "paper's 16 frames/s", reported, 0},
          {"frame_8_vessels_1280", "paper's 16 frames/s", reported, 0},
          {"frame_8_1280", "paper's 16 frames/s", at_least, 1.5},
          {"frame_8_640", "VTK frame", at_least, 25},
          {"opacity_to_frame_8_640", "VTK opacity to frame", at_least, 15},
          {"frame_true_640", "VTK frame", at_least, 12},
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
  benchmark::ClearRegisteredBenchmarks();  // with the OpenGL objects they hold, while there is a context
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
