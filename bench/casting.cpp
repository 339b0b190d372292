// Reading, casting and recasting.
#include "baselines.hpp"
#include "suite.hpp"
#include "xraycast/casting/caster.hpp"
#include "xraycast/casting/recast.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/requests/moving_caster.hpp"
#include "xraycast/requests/slab_caster.hpp"
#include "xraycast/scan/scan.hpp"

#include <fmt/format.h>

#include <array>
#include <memory>

namespace xraycast::bench {
namespace {

namespace fs = std::filesystem;

double kernel_ms(Bench& bench, const MapGeometry& map, const Opacity& opacity) {
  return cast(bench.scan, map, opacity, bench.progress).kernel_ms;
}

void cast_from_file(Bench& bench) {
  const Scan scan = open_scan(bench.file, {}, bench.progress);
  const std::int64_t slab = slab_slices_within(scan.source->geometry(), bench.device.info().max_allocation_B);
  LoadTimings timings;
  const CastResult result = cast_by_slabs(bench.device, *scan.source, bench.map(1), Opacity::paper(), slab,
                                          timings, bench.progress);
  write_body_map(result.map, fs::path(bench.file).replace_extension(".exr"));
}

/// Recasts under another opacity at every call.
void add_recast(Bench& bench, const std::string& name, const MapGeometry& map, int knots) {
  const Opacity opacity = many_knots(knots);
  std::vector<double> knots_hu;
  for (const Opacity::Knot& knot : opacity.knots()) knots_hu.push_back(knot.hu);
  const auto session =
      std::make_shared<RecastSession>(bench.device, make_basis(bench.scan, map, knots_hu, bench.progress));
  std::vector<Opacity::Knot> brighter(opacity.knots().begin(), opacity.knots().end());
  for (Opacity::Knot& knot : brighter) knot.mu_per_mm *= 1.5;
  const std::array opacities{opacity, Opacity("brighter", brighter)};
  add(name, [session, opacities, next = 0]() mutable { session->recast(opacities[next ^= 1]); });
}

void add_series_reader(Bench& bench) {
  const fs::path chest = fs::path(XRAYCAST_TEST_DATA) / "chest-dicom";
  if (!fs::exists(chest)) return;
  add("ITK series reader", [chest] { read_series_by_itk(chest); });
  add("read_dicom_275", [chest, &bench] {
    const Scan scan = open_scan(chest, {}, bench.progress);
    benchmark::DoNotOptimize(collect(*scan.source, bench.progress).hu().data());
  });
}

}  // namespace

std::vector<Row> add_casting(Bench& bench) {
  // The samples of a cast: 255 steps, 360 angles, 45 bricks of 16 slices.
  constexpr std::int64_t kSamples = std::int64_t{255} * 360 * 45;
  add("all-core read", [&bench] { read_all(bench.volume); });
  add("samples from cache", [] { sample_from_cache(kSamples); });
  add("file read", [&bench] { read_file(bench.file); });
  add("OpenCV warpPolar", [&bench] { map_by_opencv(bench.volume, 255); });
  for (const int layers : {1, 8, 16})
    add(fmt::format("cast_resident_{}", layers),
        [&bench, map = bench.body_map(layers)] { return kernel_ms(bench, map, Opacity::paper()); });
  add("cast_circles_16", [&bench, map = bench.map(16)] { return kernel_ms(bench, map, Opacity::paper()); });
  add("cast_64knots_1", [&bench, map = bench.body_map(1)] { return kernel_ms(bench, map, many_knots(64)); });
  add("cast_keys_16", [&bench, map = bench.body_map(16)] {
    cast_keys(bench.whole, map, Opacity::paper(), bench.motion, bench.keys, bench.progress);
  });
  add_recast(bench, "recast_1", bench.body_map(1), 64);
  add_recast(bench, "recast_8", bench.body_map(8), 32);
  add("cast_from_file_1", [&bench] { cast_from_file(bench); });
  add("phantom_720", [&bench] { generate(make_phantom("thorax"), bench.device, bench.progress); });
  add_series_reader(bench);
  using enum Row::Bar;
  return {{"cast_resident_1", "floor", at_most, 2},
          {"cast_resident_16", "floor", at_most, 2},
          {"cast_resident_8", "floor", reported, 0},
          {"cast_circles_16", "floor", reported, 0},
          {"cast_64knots_1", "floor", reported, 0},
          {"cast_keys_16", "5 s", at_most, 1},
          {"cast_from_file_1", "file read", at_most, 2},
          {"recast_1", "cast_resident_1", at_most, 0.08},
          {"recast_8", "cast_resident_8", at_most, 0.3},
          {"read_dicom_275", "ITK series reader", at_least, 1.6},
          {"cast_vs_opencv", "OpenCV warpPolar", at_least, 10},
          {"phantom_720", "all-core read", reported, 0}};
}

}  // namespace xraycast::bench
