// DRRs.
#include "rtk.hpp"
#include "suite.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/projection/projector.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <stdexcept>

namespace xraycast::bench {
namespace {

/// None when it cannot be had.
std::shared_ptr<RtkProjector> make_rtk(const Bench& bench) {
  try {
    return std::make_shared<RtkProjector>(bench.python, bench.file);
  } catch (const std::runtime_error& error) {
    fmt::print(stderr, "No baseline for the projections, since RTK cannot be had: {}\n", error.what());
    return nullptr;
  }
}

/// Whether a pixel's ray meets the scan between its first and its last slice's centres only. RTK's projector
/// ends at voxels' centres; ours goes on to their faces, which makes a difference where the body is cut off.
bool is_within_slices(const View& view, const VolumeGeometry& volume, int i, int j) {
  const glm::dvec3 source = view.source_mm(), way = view.pixel_on_detector_mm(i, j) - source;
  double first = 0, last = 1;
  for (int axis = 0; axis < 2; ++axis) {
    const double a = (volume.lower_mm()[axis] - source[axis]) / way[axis],
                 b = (volume.upper_mm()[axis] - source[axis]) / way[axis];
    first = std::max(first, std::min(a, b));
    last = std::min(last, std::max(a, b));
  }
  const auto is_within = [&](double t) {
    const double z = source.z + t * way.z;
    return z > volume.origin_mm.z && z < volume.upper_mm().z - 0.5 * volume.spacing_mm.z;
  };
  return is_within(first) && is_within(last);
}

/// Over the rays that meet no end of the scan.
double psnr_within_slices_db(const ProjectionImage& ours, const std::vector<float>& other,
                             const VolumeGeometry& volume) {
  std::vector<float> a, b;
  for (int j = 0; j < ours.view.height; ++j)
    for (int i = 0; i < ours.view.width; ++i) {
      if (!is_within_slices(ours.view, volume, i, j)) continue;
      const auto pixel = static_cast<std::size_t>(j) * static_cast<std::size_t>(ours.view.width) +
                         static_cast<std::size_t>(i);
      a.push_back(ours.tau[pixel]);
      b.push_back(other[pixel]);
    }
  return psnr_db(a, b);
}

/// Registers a picture under a cone, from the opacity in the host's memory to the picture there: median over
/// five angles, ours and RTK's interleaved.
void add_projection(Bench& bench, const std::shared_ptr<RtkProjector>& rtk, const std::string& name,
                    double tilt_deg, const Opacity& opacity) {
  const auto run = [&bench, rtk, tilt_deg, opacity](benchmark::State& state) {
    const bool is_rtk_opacity = opacity.name() == Opacity::paper().name();
    for (auto _ : state) {
      std::vector<double> ours_ms, rtk_ms;
      for (const double angle_deg : {0.0, 30.0, 45.0, 90.0, 200.0}) {
        const View view = c_arm(angle_deg, tilt_deg);
        ProjectionImage image;
        // At first use a driver compiles.
        if (ours_ms.empty()) image = project(bench.scan, view, opacity, bench.progress);
        ours_ms.push_back(wall_ms([&] { image = project(bench.scan, view, opacity, bench.progress); }));
        if (!rtk) continue;
        const auto [ms, tau] = rtk->project(view);
        rtk_ms.push_back(ms);
        // Both are Joseph's method in single precision; the air's half voxels at the sides are left.
        if (is_rtk_opacity && !(psnr_within_slices_db(image, tau, bench.scan.geometry()) > 70))
          state.SkipWithError("RTK's picture is another one, and no baseline");
      }
      state.SetIterationTime(median(ours_ms) / 1000);
      if (rtk) state.counters["rtk_ms"] = median(rtk_ms);
    }
  };
  benchmark::RegisterBenchmark(name.c_str(), run)
      ->UseManualTime()
      ->Unit(benchmark::kMillisecond)
      ->Iterations(1);
}

/// Nothing below dense bone absorbs.
Opacity bone() { return {"bone", {{-1000, 0}, {150, 0}, {1000, 0.06}}}; }

/// A picture with constant blocks skipped, and `NAME_everywhere` without.
void add_skipping(Bench& bench, const std::shared_ptr<const ResidentScan>& scan, const std::string& name,
                  const Opacity& opacity) {
  for (const Sampling sampling : {Sampling::skipping_constant_blocks, Sampling::everywhere})
    add(name + (sampling == Sampling::everywhere ? "_everywhere" : ""),
        [&bench, scan, opacity, sampling, angle_deg = 0.0]() mutable {
          const View view = c_arm(angle_deg += 35, 0);
          return wall_ms([&] { project(*scan, view, opacity, bench.progress, {}, sampling); });
        });
}

/// Under opacities in which much of a scan is constant, and of a scan without noise, whose air is.
void add_skipping(Bench& bench) {
  const std::shared_ptr<const ResidentScan> noisy(&bench.scan, [](const ResidentScan*) {});
  add_skipping(bench, noisy, "project_bone_640x480", bone());
  add_skipping(bench, noisy, "project_bilinear_640x480", Opacity::bilinear());
  add_skipping(bench, noisy, "project_paper_640x480", Opacity::paper());
  const Phantom without_noise = make_phantom("thorax", {.noise_hu = 0});
  const auto quiet = std::make_shared<const ResidentScan>(
      upload(bench.device, generate(without_noise, bench.device, bench.progress)));
  add_skipping(bench, quiet, "project_bilinear_quiet_640x480", Opacity::bilinear());
}

/// By the beam of a tube instead of one coefficient, and with the derivatives by the pose.
void add_spectrum_and_gradient(Bench& bench) {
  add("project_spectrum_640x480", [&bench, beam = Spectrum::named("80"), angle_deg = 0.0]() mutable {
    const View view = c_arm(angle_deg += 35, 0);
    return wall_ms([&] { project(bench.whole, view, beam, bench.progress); });
  });
  for (const double tilt_deg : {0.0, 20.0}) {
    const std::string name = tilt_deg == 0 ? "project_gradient_640x480" : "project_gradient_640x480_tilt";
    add(name, [&bench, tilt_deg, angle_deg = 0.0]() mutable {
      const View view = c_arm(angle_deg += 35, tilt_deg);
      return wall_ms([&] { project_with_gradient(bench.scan, view, Opacity::paper(), bench.progress); });
    });
  }
}

}  // namespace

std::vector<Row> add_projecting(Bench& bench) {
  const auto rtk = make_rtk(bench);
  add_projection(bench, rtk, "project_640x480", 0, Opacity::paper());
  add_projection(bench, rtk, "project_640x480_tilt", 20, Opacity::paper());
  add_projection(bench, rtk, "project_640x480_64knots", 0, many_knots(64));
  add_skipping(bench);
  add_spectrum_and_gradient(bench);
  using enum Row::Bar;
  return {{"project_640x480", "RTK, project_640x480", at_least, 10},
          {"project_640x480_tilt", "RTK, project_640x480_tilt", at_least, 6},
          {"project_640x480_64knots", "RTK, project_640x480_64knots", at_least, 3},
          {"project_spectrum_640x480", "project_bilinear_640x480", at_most, 3},
          {"project_gradient_640x480", "project_640x480", at_most, 3},
          {"project_gradient_640x480_tilt", "project_640x480_tilt", at_most, 3},
          {"project_bone_640x480", "project_bone_640x480_everywhere", at_least, 1.5},
          {"project_bilinear_quiet_640x480", "project_bilinear_quiet_640x480_everywhere", at_least, 1.5},
          {"project_bilinear_640x480", "project_bilinear_640x480_everywhere", reported, 0},
          {"project_paper_640x480", "project_paper_640x480_everywhere", reported, 0}};
}

}  // namespace xraycast::bench
