#include "command.hpp"
#include "plot.hpp"
#include "view_options.hpp"
#include "xraycast/atomic_file.hpp"
#include "xraycast/comparison.hpp"
#include "xraycast/error.hpp"
#include "xraycast/rays_within.hpp"
#include "xraycast/viewer/camera.hpp"
#include "xraycast/viewer/headless_context.hpp"
#include "xraycast/viewer/renderer.hpp"

#include <fmt/format.h>
#include <glm/vector_relational.hpp>

#include <cmath>
#include <memory>
#include <numbers>

namespace xraycast::cli {
namespace {

struct Options {
  std::string input, map, plot, cone, compositing = "path", reconstruction = "linear";
  ScanOptions scan;
  int views = 12;
};

/// The true projection of the matter that the map covers, and which pixels' rays meet it.
struct Truth {
  std::vector<float> tau;
  std::vector<std::uint8_t> counts;
};

Truth truth_of(const ResidentScan& scan, const View& view, const BodyMap& map, Progress& progress) {
  const auto rays = rays_within(view, map.geometry);
  std::vector<RaySegment> segments;
  for (const auto& ray : rays)
    if (ray) segments.push_back(*ray);
  const std::vector<float> depths = project(scan, segments, map.opacity, progress);
  Truth truth{std::vector<float>(rays.size()), std::vector<std::uint8_t>(rays.size())};
  std::size_t next = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!rays[i]) continue;
    truth.tau[i] = depths[next++];
    truth.counts[i] = 1;
  }
  return truth;
}

Json to_json(const Likeness& likeness) {
  return {{"psnr_db", likeness.psnr_db}, {"ssim", likeness.ssim}, {"rmse", likeness.rmse}};
}

/// A map's rows are its scan's slices; a sphere has a centre alone.
void check_same_scan(const MapGeometry& map, const VolumeGeometry& volume, const Options& options) {
  const auto fail = [&](const std::string& why) {
    throw InputError("{} was not cast from {}: {}", options.map, options.input, why);
  };
  const glm::dvec3 centre_mm = bounds_of(map).centre_mm, lower = volume.lower_mm(), upper = volume.upper_mm();
  if (glm::any(glm::lessThan(centre_mm, lower)) || glm::any(glm::greaterThan(centre_mm, upper)))
    fail("it lies elsewhere");
  if (map.projection == Projection::sphere) return;
  if (map.height != volume.size.z)
    fail(fmt::format("it has {} rows, but the scan has {} slices", map.height, volume.size.z));
  const double slice_mm = volume.spacing_mm.z, top_mm = upper.z - 0.5 * slice_mm;
  constexpr double kSame = 0.01;  // of a slice
  if (std::abs(map.row_spacing_mm - slice_mm) * map.height > kSame * slice_mm ||
      std::abs(map.top_mm - top_mm) > kSame * slice_mm)
    fail(
        fmt::format("its rows are {:.4g} mm apart from {:.4g} mm downwards, the scan's slices {:.4g} mm from "
                    "{:.4g} mm",
                    map.row_spacing_mm, map.top_mm, slice_mm, top_mm));
}

void compare_map(const Options& options, Session& session) {
  if (options.views < 1 || options.views > 3600)
    throw InputError("--views {}: has to be 1 to 3600", options.views);
  const std::optional<Cone> cone = parse_cone(options.cone);
  Style style;
  style.sampling.compositing = compositing_named(options.compositing);
  if (options.reconstruction == "constant") style.sampling.reconstruction = Reconstruction::constant;
  if (!options.plot.empty()) check_writable(options.plot);
  const auto map = std::make_shared<BodyMap>(read_body_map(options.map));
  if (map->spectrum)
    throw InputError("{}: a spectrum map; those that hold optical depths can be compared", options.map);
  const Scan scan = open_scan(options.input, options.scan, session.progress);
  session.say(scan.info.warnings);
  check_same_scan(map->geometry, scan.source->geometry(), options);
  Device device(session.device);
  OutlineFinder finder(scan.source->geometry());
  LoadTimings timings;
  const ResidentScan resident = load(device, *scan.source, finder, timings, session.progress);

  const HeadlessContext context;
  Renderer renderer;
  renderer.set_map(map);
  Json views = Json::array();
  Likeness sum{0, 0, 0};
  double lowest_db = 1e9;
  Curve curve{"PSNR", {}};
  for (int i = 0; i < options.views; ++i) {
    const double angle_deg = 360.0 * i / options.views;
    const BodyBounds bounds = bounds_of(map->geometry);
    const View view = fitted(
        View{.angle_rad = angle_deg * std::numbers::pi / 180, .cone = cone, .centre_mm = bounds.centre_mm},
        bounds);
    const Truth truth = truth_of(resident, view, *map, session.progress);
    const Likeness likeness =
        compare(renderer.tau(view, style), truth.tau, truth.counts, view.width, view.height);
    Json row{{"angle_deg", angle_deg}};
    row.update(to_json(likeness));
    views.push_back(row);
    curve.points.emplace_back(angle_deg, likeness.psnr_db);
    sum.psnr_db += likeness.psnr_db;
    sum.ssim += likeness.ssim;
    sum.rmse += likeness.rmse;
    lowest_db = std::min(lowest_db, likeness.psnr_db);
  }
  const double count = options.views;
  const Likeness mean{sum.psnr_db / count, sum.ssim / count, sum.rmse / count};
  if (!options.plot.empty())
    write_plot(fmt::format("{}: {} layers, {}", options.map, map->geometry.layers(), options.compositing),
               "C-arm angle (deg)", "PSNR (dB)", {curve}, options.plot);
  std::string text = fmt::format(
      "{} views of {} layers against true projections: PSNR {:.1f} dB (lowest {:.1f}), SSIM {:.3f}, "
      "RMSE of tau {:.2f} % of its maximum\n",
      options.views, map->geometry.layers(), mean.psnr_db, lowest_db, mean.ssim, 100 * mean.rmse);
  session.print({{"input", options.input}, {"map", options.map}, {"mean", to_json(mean)}, {"views", views}},
                text);
}

}  // namespace

void add_compare(CLI::App& app, Session& session) {
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      add_command(app, session, "compare", "How close frames of a map are to true projections of its scan",
                  "  xraycast compare chest.nii.gz chest.exr --views 12 --plot chest.png\n"
                  "  xraycast compare chest.nii.gz chest.exr --cone 1000,1500 --json",
                  [options, &session] { compare_map(*options, session); });
  command->add_option("INPUT", options->input, "The scan that the map was cast from")->required();
  command->add_option("MAP", options->map, "The body map")->required()->type_name("MAP.exr");
  command->add_option("--views", options->views, "How many angles, evenly around the body")
      ->capture_default_str()
      ->type_name("N");
  command->add_option("--compositing", options->compositing, "wall or path")
      ->check(CLI::IsMember({"wall", "path"}))
      ->capture_default_str()
      ->type_name("NAME");
  command
      ->add_option("--reconstruction", options->reconstruction, "path: mu between shells, linear or constant")
      ->check(CLI::IsMember({"linear", "constant"}))
      ->capture_default_str()
      ->type_name("NAME");
  command->add_option("--plot", options->plot, "Also a plot of PSNR over the angle")->type_name("PNG");
  add_cone_option(*command, options->cone);
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
