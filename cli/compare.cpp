#include "options/command.hpp"
#include "options/view_options.hpp"
#include "pictures/comparison_picture.hpp"
#include "pictures/plot.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/casting/comparison.hpp"
#include "xraycast/casting/rays_within.hpp"
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"
#include "xraycast/scene/same_scan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace xraycast::cli {
namespace {

struct CompareArguments {
  std::string input, angles, pictures, plot, plotted = "psnr", cone, compositing = "path",
                                             reconstruction = "linear";
  std::vector<std::string> maps;
  ScanOptions scan;
  int views = 12;
  double tilt_deg = 0;
  const CLI::App* command = nullptr;

  /// From this C-arm angle; the sizes are for `fitted`.
  View view(double angle_deg) const {
    ViewOptions options;
    options.cone = cone;
    options.angle_deg = angle_deg;
    options.tilt_deg = tilt_deg;
    return parse_view(options);
  }
};

/// The DRR of the part of the scan that the map covers, and the pixels whose rays meet its circle.
struct Drr {
  std::vector<float> tau;
  std::vector<std::uint8_t> counts;
  std::vector<float> whole_tau;  ///< of the whole scan
};

Drr drr_of(const ResidentScan& scan, const View& view, const BodyMap& map, Progress& progress) {
  const auto rays = rays_within(view, map.geometry);
  Drr drr{std::vector<float>(rays.size()), {}, project(scan, view, map.opacity(), progress).tau};
  for (const auto& ray : rays) drr.counts.push_back(ray ? 1 : 0);
  const std::vector<PixelSegment> parts = segments_within(view, map.geometry);
  std::vector<RaySegment> segments;
  for (const PixelSegment& part : parts) segments.push_back(part.segment);
  const std::vector<float> depths = project(scan, segments, map.opacity(), progress);
  for (std::size_t i = 0; i < parts.size(); ++i) drr.tau[parts[i].pixel] += depths[i];
  return drr;
}

/// The DRRs of the view at hand, which maps of the same opacity and extent share.
class DrrsOfView {
 public:
  DrrsOfView(const ResidentScan& scan, Progress& progress) : scan_(scan), progress_(progress) {}

  const Drr& of(const View& view, const BodyMap& map) {
    const MapGeometry extent = extent_of(map.geometry);
    if (!known_.empty() && known_.front().view != view) known_.clear();
    const auto found = std::ranges::find_if(
        known_, [&](const Known& known) { return known.opacity == map.opacity() && known.extent == extent; });
    if (found != known_.end()) return found->drr;
    known_.push_back({view, map.opacity(), extent, drr_of(scan_, view, map, progress_)});
    return known_.back().drr;
  }

 private:
  struct Known {
    View view;
    Opacity opacity;
    MapGeometry extent;
    Drr drr;
  };

  /// What of a map its DRR depends on: not how many shells there are, nor their samples.
  static MapGeometry extent_of(MapGeometry geometry) {
    geometry.radii_mm = {geometry.radii_mm.front(), geometry.radii_mm.back()};
    geometry.step_mm = 1;
    return geometry;
  }

  const ResidentScan& scan_;
  Progress& progress_;
  std::deque<Known> known_;
};

/// A picture's similarity to the DRR of what the map covers, and its PSNR against that of the whole scan.
struct Similarity {
  ImageSimilarity covered;
  double whole_psnr_db;
};

Json similarity_json(const Similarity& similarity) {
  return {{"psnr_db", similarity.covered.psnr_db},
          {"ssim", similarity.covered.ssim},
          {"rmse", similarity.covered.rmse},
          {"whole_psnr_db", similarity.whole_psnr_db}};
}

std::shared_ptr<const BodyMap> read_map(const std::string& path) {
  auto map = std::make_shared<const BodyMap>(read_body_map(path));
  if (map->spectrum())
    throw InputError("{}: a spectrum map; only maps that hold optical depths can be compared", path);
  return map;
}

/// A measure that --plot shows, and the label of its axis.
struct Measure {
  const char *name, *label;
  double (*of)(const ImageSimilarity&);
};
constexpr Measure kMeasures[] = {
    {"psnr", "PSNR (dB)", [](const ImageSimilarity& similarity) { return similarity.psnr_db; }},
    {"ssim", "SSIM", [](const ImageSimilarity& similarity) { return similarity.ssim; }},
    {"rmse", "RMSE of tau (% of the largest of all views)",
     [](const ImageSimilarity& similarity) { return 100 * similarity.rmse; }}};

const Measure& parse_measure(const std::string& name) {
  return *std::ranges::find(kMeasures, name,
                            [](const Measure& measure) { return std::string(measure.name); });
}

/// The C-arm angles of the compared frames.
std::vector<double> resolve_angles_deg(const CompareArguments& options) {
  if (!options.angles.empty()) return parse_angles_deg(options.angles, "--angles");
  if (options.views < 1 || options.views > 3600)
    throw InputError("--views {}: must be 1 to 3600", options.views);
  std::vector<double> angles_deg;
  for (int i = 0; i < options.views; ++i) angles_deg.push_back(360.0 * i / options.views);
  return angles_deg;
}

/// Throws InputError when --pictures is not a folder or two maps' pictures would have the same names.
void check_pictures(const CompareArguments& options) {
  namespace fs = std::filesystem;
  if (fs::exists(options.pictures) && !fs::is_directory(options.pictures))
    throw InputError("--pictures {}: is a file; name a folder", options.pictures);
  std::vector<std::string> names;
  for (const std::string& map : options.maps) names.push_back(fs::path(map).stem().string());
  std::ranges::sort(names);
  if (const auto twice = std::ranges::adjacent_find(names); twice != names.end())
    throw InputError(
        "--pictures {}: two maps are named {}, so their pictures would overwrite each other; rename one",
        options.pictures, *twice);
}

void make_picture_folder(const CompareArguments& options) {
  make_folder(options.pictures, "--pictures " + options.pictures);
  check_writable(std::filesystem::path(options.pictures) / "picture.png");
}

/// One map's frames against the scan: {"map", "mean", "views"}, a line of text, and a measure over the angle.
struct Comparison {
  Json json;
  std::string text;
  Curve curve;
};

/// A map, what draws it, and what its frames were found to be.
struct Compared {
  std::shared_ptr<const BodyMap> map;
  std::string name;
  std::unique_ptr<Renderer> renderer;
  std::vector<Similarity> similarities;

  /// The content of the map, as text for the user.
  std::string contents() const {
    const MapGeometry& geometry = map->geometry;
    return pluralize(geometry.layers(), geometry.projection == Projection::rectangle ? "picture" : "layer");
  }
  std::string title() const {
    return fmt::format("{}, {}", std::filesystem::path(name).stem().string(), contents());
  }
};

void write_view(const View& view, const std::vector<float>& frame, const Drr& drr,
                const ImageSimilarity& similarity, double angle_deg, const Compared& compared,
                const CompareArguments& options) {
  write_comparison_picture(
      fmt::format("{}, {}: PSNR {:.1f} dB, SSIM {:.3f}", compared.title(), label(view), similarity.psnr_db,
                  similarity.ssim),
      frame, drr.tau, view.width,
      std::filesystem::path(options.pictures) /
          fmt::format("{}-{:03g}.png", std::filesystem::path(compared.name).stem().string(), angle_deg));
}

void compare_view(Compared& compared, double angle_deg, const Style& style, DrrsOfView& drrs,
                  const CompareArguments& options) {
  const BodyBounds bounds = bounds_of(compared.map->geometry);
  View view = options.view(angle_deg);
  view.centre_mm = bounds.centre_mm;
  view = fitted(view, bounds);
  const std::vector<float> frame = compared.renderer->tau(view, style);
  const Drr& drr = drrs.of(view, *compared.map);
  const auto similarity_to = [&](const std::vector<float>& tau) {
    return compare(frame, tau, drr.counts, view.width, view.height);
  };
  const Similarity similarity{similarity_to(drr.tau), similarity_to(drr.whole_tau).psnr_db};
  if (!options.pictures.empty())
    write_view(view, frame, drr, similarity.covered, angle_deg, compared, options);
  compared.similarities.push_back(similarity);
}

/// Errors of optical depth become shares of the largest in any view: shares of each view's own would weigh
/// thin views more.
void take_largest_of_all(std::vector<Similarity>& similarities) {
  double deepest = 0;
  for (const Similarity& one : similarities) deepest = std::max(deepest, one.covered.deepest);
  for (Similarity& one : similarities)
    if (deepest > 0) one.covered.rmse *= one.covered.deepest / deepest;
}

Similarity mean_of(const std::vector<Similarity>& similarities) {
  Similarity mean{{0, 0, 0, 0}, 0};
  const auto count = static_cast<double>(similarities.size());
  for (const auto& [covered, whole_psnr_db] : similarities) {
    mean.covered.psnr_db += covered.psnr_db / count;
    mean.covered.ssim += covered.ssim / count;
    mean.covered.rmse += covered.rmse / count;
    mean.whole_psnr_db += whole_psnr_db / count;
  }
  return mean;
}

Comparison comparison_of(Compared& compared, const std::vector<double>& angles_deg, const Measure& plotted) {
  std::vector<Similarity>& similarities = compared.similarities;
  take_largest_of_all(similarities);
  Curve curve{compared.title(), {}};
  Json views = Json::array();
  double lowest_db = 1e9;
  for (std::size_t i = 0; i < angles_deg.size(); ++i) {
    Json row{{"angle_deg", angles_deg[i]}};
    row.update(similarity_json(similarities[i]));
    views.push_back(row);
    curve.points.emplace_back(angles_deg[i], plotted.of(similarities[i].covered));
    lowest_db = std::min(lowest_db, similarities[i].covered.psnr_db);
  }
  const Similarity mean = mean_of(similarities);
  return {
      {{"map", compared.name}, {"mean", similarity_json(mean)}, {"views", views}},
      fmt::format("{}: {} of {} against true projections: PSNR {:.1f} dB (lowest {:.1f}), "
                  "SSIM {:.3f}, RMSE of tau {:.2f} % of its maximum; PSNR against the whole scan {:.1f} dB\n",
                  compared.name, pluralize(views.size(), "view"), compared.contents(), mean.covered.psnr_db,
                  lowest_db, mean.covered.ssim, 100 * mean.covered.rmse, mean.whole_psnr_db),
      curve};
}

void compare_maps(const CompareArguments& options, Invocation& invocation) {
  const std::vector<double> angles_deg = resolve_angles_deg(options);
  options.view(0);
  Style style;
  style.sampling.compositing = parse_compositing(options.compositing);
  if (options.reconstruction == "constant") style.sampling.reconstruction = Reconstruction::constant;
  if (style.sampling.compositing == Compositing::wall)
    check_not_given(*options.command, {"--reconstruction"}, "to --compositing wall; leave it out");
  if (options.plot.empty())
    check_not_given(*options.command, {"--plot-of"}, "without a plot; leave it out or give --plot too");
  else
    check_picture_name(options.plot, "--plot " + options.plot);
  if (!options.pictures.empty()) check_pictures(options);
  std::vector<std::shared_ptr<const BodyMap>> maps;
  for (const std::string& path : options.maps) maps.push_back(read_map(path));
  const Scan scan = open_scan(options.input, options.scan, invocation.progress);
  invocation.say_about(scan.info);
  for (std::size_t i = 0; i < maps.size(); ++i)
    check_same_scan(maps[i]->geometry, options.maps[i], scan.source->geometry(), options.input);
  if (!options.pictures.empty()) make_picture_folder(options);
  ComputeDevice device(invocation.device);
  OutlineFinder finder(scan.source->geometry());
  LoadTimings timings;
  const ResidentScan resident = load(device, *scan.source, finder, timings, invocation.progress);
  invocation.say_about(*scan.source);

  const HeadlessContext context;
  std::vector<Compared> all_compared;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    all_compared.push_back({maps[i], options.maps[i], std::make_unique<Renderer>(), {}});
    all_compared.back().renderer->set_map(maps[i]);
  }
  // The stages of each projection are not told, only ended with the whole.
  Progress of_each([&](const Progress::State&) { invocation.progress.check(); });
  DrrsOfView drrs(resident, of_each);
  invocation.progress.begin("comparing", std::ssize(angles_deg) * std::ssize(all_compared), "frames");
  for (const double angle_deg : angles_deg)
    for (Compared& one : all_compared) {
      compare_view(one, angle_deg, style, drrs, options);
      invocation.progress.advance();
    }

  Json all = Json::array();
  std::string text;
  std::vector<Curve> curves;
  for (Compared& one : all_compared) {
    Comparison comparison = comparison_of(one, angles_deg, parse_measure(options.plotted));
    all.push_back(std::move(comparison.json));
    text += comparison.text;
    curves.push_back(std::move(comparison.curve));
  }
  if (!options.plot.empty())
    write_plot(fmt::format("{}, compositing {}", std::filesystem::path(options.input).filename().string(),
                           options.compositing),
               "C-arm angle (deg)", parse_measure(options.plotted).label, curves, options.plot);
  Json result{{"input", options.input}};
  if (all.size() == 1)
    result.update(all[0]);
  else
    result["maps"] = all;
  invocation.answer(result, text);
}

}  // namespace

void add_compare(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<CompareArguments>();
  CLI::App* command = add_command(
      app, invocation, "compare", "Compare frames of body maps with true projections (DRRs) of their scan",
      "  xraycast compare chest.nii.gz chest.exr --views 12 --plot chest.png\n"
      "  xraycast compare chest.nii.gz chest.exr --views 4 --pictures chest-views\n"
      "  xraycast compare chest.nii.gz chest-8.exr chest-16.exr chest-32.exr --plot layers.png\n"
      "  xraycast compare chest.nii.gz chest.exr pictures.exr --angles 0:31:1 --plot-of rmse --plot p.png\n"
      "  xraycast compare chest.nii.gz chest.exr --cone 1000,1500 --tilt 20 --json",
      [options, &invocation] { compare_maps(*options, invocation); });
  options->command = command;
  command->add_option("INPUT", options->input, "The scan that the maps were cast from")->required();
  command->add_option("MAP", options->maps, "Body maps cast from it")->required()->type_name("MAP.exr...");
  auto* views =
      command->add_option("--views", options->views, "Number of C-arm angles, evenly spaced around the body")
          ->capture_default_str()
          ->type_name("N");
  command->add_option("--angles", options->angles, "These C-arm angles in degrees instead; TO is excluded")
      ->excludes(views)
      ->type_name("FROM:TO:STEP");
  command->add_option("--compositing", options->compositing, "As in `xraycast render`")
      ->check(CLI::IsMember({"wall", "path"}))
      ->capture_default_str()
      ->type_name("NAME");
  command->add_option("--reconstruction", options->reconstruction, "As in `xraycast render`")
      ->check(CLI::IsMember({"linear", "constant"}))
      ->capture_default_str()
      ->type_name("NAME");
  command
      ->add_option("--pictures", options->pictures,
                   "Also write a PNG per view: the map's frame, the true projection, and their difference")
      ->type_name("DIR");
  command->add_option("--plot", options->plot, "Also plot the similarity against the C-arm angle")
      ->type_name("IMAGE");
  command->add_option("--plot-of", options->plotted, "What to plot: psnr, ssim, or the error rmse")
      ->check(CLI::IsMember({"psnr", "ssim", "rmse"}))
      ->capture_default_str()
      ->type_name("NAME");
  command
      ->add_option("--tilt,--cranial", options->tilt_deg,
                   "Tilt of the detector in all views: cranial positive, caudal negative")
      ->capture_default_str()
      ->type_name("DEG");
  add_cone_option(*command, options->cone);
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
