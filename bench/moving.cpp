#include "moving.hpp"

#include "xraycast/acquisition/compare_request.hpp"
#include "xraycast/casting/caster.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/requests/body_fit.hpp"
#include "xraycast/requests/moving_caster.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <random>

namespace xraycast::bench {
namespace {

constexpr int kLayers = 16, kInstants = 10;

/// A map that is tried, and what was found.
struct Tried {
  std::string name;
  std::shared_ptr<const BodyMap> map{};  ///< none: of the instant's own phantom
  double seconds = 0;
  std::vector<double> psnr_db{}, less_db{};  ///< of each frame, and by how much that of its own map has more
};

Tried keys_of(Bench& bench, int breath, int heart) {
  const KeyPhases keys = key_phases(bench.motion, {{"breath", breath}, {"heart", heart}});
  OutlineFinder body = bench.body;
  MapGeometry circles = bench.map(kLayers);
  circles.radii_mm = shell_radii_mm(RadiiRule::near_skin, kLayers, circles.radius_mm());
  const MapGeometry geometry =
      fit_to_body(circles, body, moved_skin_mm(body, bench.volume.geometry(), bench.motion, keys));
  Tried tried{fmt::format("{} x {}", breath, heart)};
  tried.seconds =
      wall_ms([&] {
        tried.map = std::make_shared<BodyMap>(
            cast_keys(bench.whole, geometry, Opacity::paper(), bench.motion, keys, bench.progress).map);
      }) /
      1000;
  return tried;
}

void compare_at(Bench& bench, double breath, double heart, std::vector<Tried>& all) {
  const Volume volume = generate(make_phantom("thorax", {.phase = {{"breath", breath}, {"heart", heart}}}),
                                 bench.device, bench.progress);
  const ResidentScan scan = upload(bench.device, volume);
  OutlineFinder body(volume.geometry(), {.finds_skin = true});
  body.add(volume.hu());
  MapGeometry circles = bench.map(kLayers);
  circles.radii_mm = shell_radii_mm(RadiiRule::near_skin, kLayers, circles.radius_mm());
  CompareRequest request{.angles_deg = {0, 35, 90}};
  const std::vector<double> instant{breath, heart};
  for (const Tried& tried : all) {
    std::shared_ptr<const BodyMap> map = tried.map;
    if (!map)
      map = std::make_shared<BodyMap>(
          cast(scan, fit_to_body(circles, body), Opacity::paper(), bench.progress).map);
    else if (map->keys)
      map = std::make_shared<BodyMap>(map_at(*map, instant));
    request.maps.push_back({map, tried.name});
  }
  const std::vector<MapComparison> found = compare(request, scan, bench.progress);
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t view = 0; view < request.angles_deg.size(); ++view) {
      const double own = found[0].views[view].covered.psnr_db, psnr_db = found[i].views[view].covered.psnr_db;
      all[i].psnr_db.push_back(psnr_db);
      all[i].less_db.push_back(own - psnr_db);
    }
}

double mean_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

}  // namespace

void measure_moving(Bench& bench) {
  std::vector<Tried> all{{"its own"}};
  all.push_back(
      {"still", std::make_shared<BodyMap>(
                    cast(bench.scan, bench.body_map(kLayers), Opacity::paper(), bench.progress).map)});
  constexpr std::pair<int, int> kGrids[] = {{2, 4}, {3, 4}, {3, 6}, {4, 6}, {4, 8}, {5, 8}, {9, 16}};
  for (const auto& [breath, heart] : kGrids) all.push_back(keys_of(bench, breath, heart));
  std::mt19937 random(2);
  std::uniform_real_distribution<double> phase(0, 1);
  for (int i = 0; i < kInstants; ++i) {
    const double breath = phase(random), heart = phase(random);
    compare_at(bench, breath, heart, all);
    fmt::print("instant {}: breath {:.3f}, heart {:.3f}", i, breath, heart);
    for (const Tried& one : all)
      fmt::print("; {} {:.2f}", one.name, mean_of({one.psnr_db.end() - 3, one.psnr_db.end()}));
    fmt::print("\n");
    std::fflush(stdout);
  }
  fmt::print("| key phases | MB | s | PSNR | less than its own, mean | most |\n|---|---|---|---|---|---|\n");
  for (const Tried& one : all)
    fmt::print("| {} | {:.1f} | {:.1f} | {:.2f} | {:.2f} | {:.2f} |\n", one.name,
               one.map && one.map->keys ? static_cast<double>(one.map->keys->size_B()) / 1e6 : 0.0,
               one.seconds, mean_of(one.psnr_db), mean_of(one.less_db), std::ranges::max(one.less_db));
}

}  // namespace xraycast::bench
