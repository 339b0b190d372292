#include "options/command.hpp"
#include "options/motion_options.hpp"
#include "options/view_options.hpp"
#include "xraycast/acquisition/compare_request.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/casting/key_maps.hpp"
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/reports/comparison_report.hpp"
#include "xraycast/scan/scan.hpp"
#include "xraycast/scene/same_scan.hpp"
#include "xraycast/scene/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace xraycast::cli {
namespace {

struct CompareArguments {
  std::string input, angles, pictures, plot, plotted = "psnr", cone, compositing = "path",
                                             reconstruction = "linear";
  std::vector<std::string> maps;
  ScanOptions scan;
  MotionOptions motion;
  int views = 12;
  CompareRequest request;
  const CLI::App* command = nullptr;
};

/// The request, without the maps.
CompareRequest parse_request(const CompareArguments& options) {
  CompareRequest request = options.request;
  request.angles_deg = options.angles.empty() ? angles_around_deg(options.views)
                                              : parse_angles_deg(options.angles, "--angles");
  request.cone = parse_cone(options.cone);
  request.sampling.compositing = parse_compositing(options.compositing);
  request.sampling.reconstruction = parse_reconstruction(options.reconstruction);
  return request;
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

void write_frame(const ComparedFrame& frame, const CompareRequest& request, const std::string& folder) {
  const auto [width, height, greys] = comparison_picture(request, frame);
  const std::filesystem::path map = request.maps[frame.map].name;
  write_picture(
      greys, width, height, 1,
      folder / std::filesystem::path(fmt::format("{}-{:03}.png", map.stem().string(), frame.angle_deg)));
}

Json json_of(const FrameSimilarity& similarity) {
  return {{"psnr_db", similarity.covered.psnr_db},
          {"ssim", similarity.covered.ssim},
          {"rmse", similarity.covered.rmse},
          {"whole_psnr_db", similarity.whole_psnr_db}};
}

/// {"map", "mean", "views"}
Json json_of(const MapComparison& comparison, const std::string& map, const std::vector<double>& angles_deg) {
  Json views = Json::array();
  for (std::size_t i = 0; i < angles_deg.size(); ++i) {
    views.push_back({{"angle_deg", angles_deg[i]}});
    views.back().update(json_of(comparison.views[i]));
  }
  return {{"map", map}, {"mean", json_of(comparison.mean)}, {"views", views}};
}

std::string text_of(const MapComparison& comparison, const ComparedMap& compared) {
  const auto& [covered, whole_psnr_db] = comparison.mean;
  const auto lowest = std::ranges::min(comparison.views, {},
                                       [](const FrameSimilarity& view) { return view.covered.psnr_db; });
  return fmt::format(
      "{}: {} of {} against true projections: PSNR {:.1f} dB (lowest {:.1f}), "
      "SSIM {:.3f}, RMSE of tau {:.2f} % of its maximum; PSNR against the whole scan {:.1f} dB\n",
      compared.name, pluralize(comparison.views.size(), "view"), contents_of(*compared.map), covered.psnr_db,
      lowest.covered.psnr_db, covered.ssim, 100 * covered.rmse, whole_psnr_db);
}

void report_comparisons(const std::vector<MapComparison>& comparisons, const CompareRequest& request,
                        const CompareArguments& options, const Invocation& invocation) {
  Json result{{"input", options.input}}, all = Json::array();
  std::string text;
  for (std::size_t i = 0; i < comparisons.size(); ++i) {
    all.push_back(json_of(comparisons[i], request.maps[i].name, request.angles_deg));
    text += text_of(comparisons[i], request.maps[i]);
  }
  if (all.size() == 1)
    result.update(all[0]);
  else
    result["maps"] = all;
  invocation.answer(result, text);
}

/// The instant at which the scan is taken. The motion is that of a map that moves, unless another is given.
MotionRequest instant_of_scan(const CompareArguments& options, const CompareRequest& request) {
  MotionRequest instant = motion_request_of(options.motion);
  const auto moving =
      std::ranges::find_if(request.maps, [](const ComparedMap& one) { return one.map->keys != nullptr; });
  if (moving == request.maps.end() || !instant.motion.empty() || (instant.phase.empty() && !instant.time_s))
    return instant;
  instant.motion = moving->map->keys->motion;
  std::error_code error;
  if (!std::filesystem::is_regular_file(instant.motion, error))
    throw InputError("{}: its motion {} is not there; give --motion", moving->name, instant.motion.string());
  return instant;
}

/// Maps of another scan may have the same grid: those that name another file than the scan's.
std::vector<std::string> notes_on_sources(const CompareRequest& request, const std::string& scan,
                                          const std::string& format) {
  std::vector<std::string> notes;
  for (const auto& [map, name] : request.maps)
    if (!may_be_source(map->source, scan, format))
      notes.push_back(
          fmt::format("{}: was cast from {}; the figures are only right where {} is the same scan", name,
                      map->source.empty() ? "an unnamed scan" : excerpt(map->source), scan));
  return notes;
}

void compare_maps(const CompareArguments& options, Invocation& invocation) {
  CompareRequest request = parse_request(options);
  if (request.sampling.compositing == Compositing::wall)
    check_not_given(*options.command, {"--reconstruction"}, "to --compositing wall; leave it out");
  if (options.plot.empty())
    check_not_given(*options.command, {"--plot-of"}, "without a plot; leave it out or give --plot too");
  else
    check_picture_name(options.plot, "--plot " + options.plot);
  if (!options.pictures.empty()) check_pictures(options);
  for (const std::string& path : options.maps)
    request.maps.push_back({std::make_shared<const BodyMap>(read_body_map(path)), path});
  check(request);
  const MotionOfRequest motion = held_motion(instant_of_scan(options, request));
  request.phase = {motion.phases.begin(), motion.phases.end()};
  const std::string scan_name = options.input + motion.suffix();
  Scan scan = open_scan(options.input, options.scan, invocation.progress);
  check(request, scan.source->geometry(), scan_name);
  invocation.say(notes_on_sources(request, options.input, scan.info.format));
  scan = moved(std::move(scan), motion, invocation.progress);
  invocation.say_about(scan.info);
  if (!options.pictures.empty()) make_picture_folder(options);
  ComputeDevice device(invocation.device);
  OutlineFinder finder(scan.source->geometry());
  LoadTimings timings;
  const ResidentScan resident = load(device, *scan.source, finder, timings, invocation.progress);
  invocation.say_about(*scan.source);

  const HeadlessContext context;
  std::optional<OutputSeries> pictures(std::in_place);
  const std::vector<MapComparison> comparisons =
      compare(request, resident, invocation.progress, [&](const ComparedFrame& frame) {
        if (!options.pictures.empty()) write_frame(frame, request, options.pictures);
      });
  pictures.reset();
  if (!options.plot.empty())
    write_picture(comparison_plot(scan_name, options.plotted, request, comparisons), options.plot);
  report_comparisons(comparisons, request, options, invocation);
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
      "  xraycast compare chest.nii.gz chest.exr --cone 1000,1500 --tilt 20 --json\n"
      "  xraycast compare chest.nii.gz moving.exr --phase breath=0.3 --phase heart=0.8",
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
      ->add_option("--tilt,--cranial", options->request.cranial_deg,
                   "Tilt of the detector in all views: cranial positive, caudal negative")
      ->capture_default_str()
      ->type_name("DEG");
  add_cone_option(*command, options->cone);
  command
      ->add_option(
          "--motion", options->motion.motion,
          "How the body moves, a motion.json, by which the scan is moved too (default: that of a map "
          "that moves)")
      ->type_name("FILE");
  add_instant_options(*command, options->motion);
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
