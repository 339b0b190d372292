#include "suite.hpp"

#include "xraycast/phantom/phantom.hpp"
#include "xraycast/phantom/phantom_motion_file.hpp"
#include "xraycast/requests/body_fit.hpp"
#include "xraycast/scan/scan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

namespace xraycast::bench {

namespace fs = std::filesystem;

namespace {

Motion thorax_motion(const fs::path& folder, Progress& progress) {
  constexpr double kNodes_mm = 4;
  fs::create_directories(folder);
  write_motion(make_phantom("thorax"), folder, kNodes_mm, progress);
  return read_motion(folder / "motion.json");
}

}  // namespace

Bench::Bench(fs::path folder, fs::path interpreter)
    : volume(generate(make_phantom("thorax"), device, progress)),
      whole{upload(device, volume), {}},
      scan(whole.native),
      body(volume.geometry(), {.finds_skin = true}),
      file(folder / "bench-thorax.nrrd"),
      python(std::move(interpreter)),
      motion(thorax_motion(folder / "bench-thorax-motion", progress)),
      keys(key_phases(motion, {})) {
  body.add(volume.hu());
  write_volume(volume, file, progress);
}

MapGeometry Bench::map(int layers, int angles) const {
  const VolumeGeometry& g = volume.geometry();
  const glm::dvec3 middle = g.to_world_mm(0.5 * glm::dvec3(g.size - Index3(1)));
  return cylinder_map(g, angles, shell_radii_mm(RadiiRule::equal_area, layers, 255 * g.spacing_mm.x),
                      glm::dvec2(middle));
}

MapGeometry Bench::body_map(int layers) const {
  MapGeometry circles = map(layers);
  circles.radii_mm = shell_radii_mm(RadiiRule::near_skin, layers, circles.radius_mm());
  return fit_to_body(circles, body);
}

MapGeometry Bench::pictures(int views) const {
  const MapGeometry cylinder = map(1);
  return rectangle_map(volume.geometry(), views, cylinder.radius_mm(), cylinder.centre_mm[0]);
}

Opacity many_knots(int count) {
  std::vector<Opacity::Knot> knots;
  for (int i = 0; i < count; ++i)
    knots.push_back({-1000.0 + 2500.0 / count * i, 0.0005 * i * (1 + 0.2 * (i % 3))});
  return {fmt::format("{} knots", count), knots};
}

View c_arm(double angle_deg, double tilt_deg) {
  constexpr double kRadians = std::numbers::pi / 180;
  return {.lao_rad = angle_deg * kRadians,
          .cranial_rad = tilt_deg * kRadians,
          .cone = Cone{1000, 1500},
          .width = 640,
          .height = 480,
          .pixel_mm = 0.9};
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

}  // namespace xraycast::bench
