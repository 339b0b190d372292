#include "xraycast/segmentation/segment.hpp"

#include "options/command.hpp"
#include "pictures/step_pictures.hpp"
#include "pictures/vessel_report.hpp"
#include "xraycast/attenuation/materials.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/segmentation/centreline.hpp"
#include "xraycast/segmentation/contrast.hpp"
#include "xraycast/segmentation/seeds.hpp"
#include "xraycast/segmentation/surface.hpp"
#include "xraycast/segmentation/vessel_selection.hpp"
#include "xraycast/series/seg_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>

namespace xraycast::cli {
namespace {

namespace fs = std::filesystem;

struct SegmentArguments {
  std::string input, folder, explain, from_mask, window = "auto", surface = "level-set", root;
  std::vector<std::string> seeds, not_vessels;
  ScanOptions scan;
  SegmentOptions segment;
  std::size_t triangles = 50'000;
  const CLI::App* command = nullptr;
};

std::vector<glm::dvec3> parse_points(const std::vector<std::string>& texts, const std::string& option) {
  std::vector<glm::dvec3> points_mm;
  for (const std::string& text : texts) {
    const std::vector<double> numbers = parse_numbers(text, option);
    if (numbers.size() != 3) throw InputError("{} {}: must be X,Y,Z in mm (LPS)", option, text);
    points_mm.emplace_back(numbers[0], numbers[1], numbers[2]);
  }
  return points_mm;
}

SegmentOptions parsed(const SegmentArguments& options) {
  if (!options.from_mask.empty())
    check_not_given(*options.command, {"--not", "--window", "--max-radius"},
                    "to --from-mask, whose voxels are the vessels; leave it out");
  SegmentOptions segment = options.segment;
  segment.markers.vessels_mm = parse_points(options.seeds, "--seed");
  segment.markers.not_vessels_mm = parse_points(options.not_vessels, "--not");
  if (!(segment.markers.max_radius_mm > 0))
    throw InputError("--max-radius {}: must be above zero", segment.markers.max_radius_mm);
  if (options.triangles < 100) throw InputError("--triangles {}: must be 100 or more", options.triangles);
  if (options.window != "auto") {
    const std::vector<double> limits = parse_numbers(options.window, "--window");
    if (limits.size() != 2 || limits[0] >= limits[1])
      throw InputError("--window {}: must be auto or LO,HI in HU, the lower one first", options.window);
    segment.window_hu = {limits[0], limits[1]};
  }
  return segment;
}

/// A mask from another program, on the scan's grid.
Mask read_mask(const std::string& file, const VolumeGeometry& grid, Progress& progress) {
  const Scan scan = open_scan(file, {}, progress);
  check_mask_grid(scan.source->geometry(), grid, "--from-mask " + file);
  const Volume values = collect(*scan.source, progress, file);
  return between(values, 1, 32767);
}

/// The components with seeds; without seeds all but the smallest, whatever their shape, since the mask
/// defines the vessels.
Mask selected_components(const Mask& mask, const Markers& markers, const std::string& name,
                         Session& session) {
  if (!markers.vessels_mm.empty()) return select_vessels(mask, markers, name, session.progress);
  Mask kept = without_small_components(mask);
  if (const std::int64_t dropped = mask.count() - kept.count(); dropped > 0)
    session.say(
        {fmt::format("{}: left out components of less than 1 % of the largest one, {} in all; give a --seed "
                     "in one to keep it",
                     name, pluralize(dropped, "voxel"))});
  return kept;
}

/// Text on how several components of the mask were linked to one tree.
std::string linked(const Centrelines& found) {
  std::string words;
  if (found.gaps_mm.size() == 1)
    words = fmt::format(", one gap of {:.0f} mm closed", found.gaps_mm.front());
  else if (!found.gaps_mm.empty())
    words = fmt::format(", {} gaps of up to {:.0f} mm closed", found.gaps_mm.size(),
                        std::ranges::max(found.gaps_mm));
  if (found.parts_left_out > 0)
    words += fmt::format(", {} of the mask left out, too far away to be linked",
                         pluralize(found.parts_left_out, "component"));
  return words;
}

constexpr const char* kSegName = "mask.seg.dcm";

/// The mask as a DICOM Segmentation, where the scan's slices let it be one.
void write_dicom_mask(const Mask& mask, const ScanInfo& scan, const SegmentArguments& options,
                      const fs::path& folder) {
  if (!why_no_seg(scan).empty()) return;
  const bool is_automatic = options.seeds.empty() && options.not_vessels.empty() && options.from_mask.empty();
  write_seg(scan, mask.geometry.spacing_mm.z, mask.voxels, {is_automatic, XRAYCAST_VERSION},
            folder / kSegName);
}

/// One of an earlier run, where this one wrote none.
void remove_stale_seg(const ScanInfo& scan, const fs::path& folder) {
  std::error_code error;
  if (why_no_seg(scan).empty() || fs::remove(folder / kSegName, error) || !error) return;
  throw InputError("{}: the file of an earlier run cannot be removed: {}; delete it",
                   (folder / kSegName).string(), error.message());
}

/// What is to be known of mask.seg.dcm, in a line.
std::string seg_note(const ScanInfo& scan, const std::string& why_none) {
  if (!why_none.empty()) return fmt::format("no {}: {}\n", kSegName, why_none);
  if (frame_of_reference_uid(scan).empty())
    return fmt::format(
        "{}: has its own frame of reference, because the slices have none in common; some viewers will not "
        "overlay it on them\n",
        kSegName);
  return "";
}

/// What makes a segmentation accept a seed.
const char* remedy(LostSeed::Cause cause, bool has_window) {
  switch (cause) {
    case LostSeed::Cause::window:
      return has_window ? "; give a --window that includes it, or leave --window out"
                        : "; give a --window that includes it";
    case LostSeed::Cause::chamber:
      return ", and counts as a heart chamber; raise --max-radius";
    case LostSeed::Cause::body:
      return "; to use it all the same, give a mask by --from-mask";
    default:
      return "; give a --seed in a vessel";
  }
}

/// The vessels by the steps, which --explain shows.
SegmentedVessels segmented(const Volume& volume, const SegmentOptions& segmenting,
                           const SegmentArguments& options, ComputeDevice& device, Session& session,
                           SegmentLog& log) {
  std::optional<StepPictures> steps;
  if (!options.explain.empty()) {
    make_folder(options.explain, "--explain " + options.explain);
    steps.emplace(options.explain);
    log.on_step = [&](const std::string& step, const Mask& mask) { steps->add(step, mask); };
  }
  try {
    SegmentedVessels vessels =
        segment_vessels(volume, segmenting, options.input, device, session.progress, &log);
    if (steps) steps->finish(volume);
    return vessels;
  } catch (const LostSeed& error) {
    if (steps) steps->finish(volume);
    throw InputError("{}{}", error.what(), remedy(error.cause(), segmenting.window_hu.has_value()));
  } catch (const NoContrast& error) {
    if (steps) steps->finish(volume);
    throw InputError(
        "{}; check in the scan which are vessels, and give one by --seed X,Y,Z, or a mask by --from-mask",
        error.what());
  }
}

/// What is found in a scan.
struct Findings {
  SegmentedVessels vessels;
  Centrelines centrelines;
  Mesh surface;
  SegmentLog log;
  double weak = 0;  ///< see weak_share
};

std::string counts_of(const Centrelines& centrelines) {
  return pluralize(centrelines.tree.branches().size(), "branch") + ", " +
         pluralize(centrelines.loops.size(), "loop");
}

SegmentedVessels vessels_in(const Volume& volume, const SegmentOptions& segmenting,
                            const SegmentArguments& options, ComputeDevice& device, Session& session,
                            SegmentLog& log) {
  if (options.from_mask.empty()) return segmented(volume, segmenting, options, device, session, log);
  const Mask mask = read_mask(options.from_mask, volume.geometry(), session.progress);
  return with_fill(volume, selected_components(mask, segmenting.markers, options.from_mask, session));
}

Findings findings_in(const Volume& volume, const SegmentOptions& segmenting, const SegmentArguments& options,
                     const std::optional<glm::dvec3>& root_mm, Session& session) {
  Progress& progress = session.progress;
  ComputeDevice device(session.device);
  SegmentLog log;
  SegmentedVessels vessels = vessels_in(volume, segmenting, options, device, session, log);
  Centrelines centrelines =
      extract_centrelines(vessels.mask, options.input, progress, root_mm, &vessels.fill);
  const VesselTree& tree = centrelines.tree;
  if (root_mm)
    check_near_end(tree.branches()[static_cast<std::size_t>(tree.root())].points.front().position_mm,
                   *root_mm, "--root " + options.root);
  progress.begin("surface", 1, "surfaces");
  Mesh surface = options.surface == "tubes" ? tube_mesh(tree)
                                            : surface_of(vessels.mask, vessels.fill, options.triangles);
  progress.advance();
  if (!options.from_mask.empty()) log.noise_hu = measure_noise_hu(volume);
  const double weak = weak_share(tree, volume, log.noise_hu);
  return {std::move(vessels), std::move(centrelines), std::move(surface), std::move(log), weak};
}

/// All files or none: a mask beside another scan's report would be misleading.
void write_findings(const Findings& found, const ScanInfo& scan, const Volume& volume,
                    const SegmentOptions& segmenting, const SegmentArguments& options) {
  const fs::path folder = options.folder;
  const auto& [mask, fill] = found.vessels;
  make_folder(folder, "-o " + options.folder);
  OutputSet outputs;
  write_mask(mask.geometry, mask.voxels, folder / "mask.nrrd");
  write_shares(fill.geometry, fill.shares, folder / "lumen.nrrd");
  write_dicom_mask(mask, scan, options, folder);
  write_tree(found.centrelines.tree, folder / "tree.vtp");
  write_tree(found.centrelines.tree, folder / "tree.json");
  write_mesh(found.surface, folder / "surface.vtp");
  write_mesh(found.surface, folder / "surface.stl");
  write_vessel_report(fmt::format("{}: {}", options.input, counts_of(found.centrelines)),
                      options.from_mask.empty() ? assumptions(found.log, segmenting, found.weak)
                                                : "the mask " + options.from_mask,
                      volume, mask, found.centrelines.tree, folder / "report.png");
  outputs.commit();
  remove_stale_seg(scan, folder);
}

void report_findings(const Findings& found, const ScanInfo& scan, const SegmentArguments& options,
                     double total_ms, const Session& session) {
  const fs::path folder = options.folder;
  const auto& [vessels, centrelines, surface, log, weak] = found;
  const std::string why_none = why_no_seg(scan);
  session.report({{"input", options.input},
                  {"folder", options.folder},
                  {"seg", why_none.empty() ? Json((folder / kSegName).string()) : Json()},
                  {"no_seg", why_none.empty() ? Json() : Json(why_none)},
                  {"voxels", vessels.mask.count()},
                  {"lumen_mm3", vessels.fill.volume_mm3()},
                  {"evidence", log.scale ? Json{{"lumen_hu", log.scale->lumen_hu},
                                                {"noise_hu", log.scale->noise_hu},
                                                {"blur_vox", log.scale->blur_vox}}
                                         : Json()},
                  {"window_hu", log.window ? Json{log.window->low_hu, log.window->high_hu} : Json()},
                  {"noise_hu", log.noise_hu},
                  {"weak_share", weak},
                  {"branches", centrelines.tree.branches().size()},
                  {"loops", centrelines.loops},
                  {"gaps_mm", centrelines.gaps_mm},
                  {"parts_left_out", centrelines.parts_left_out},
                  {"triangles", surface.triangles.size()},
                  {"timings_ms", {{"total", total_ms}}}},
                 fmt::format("{}: {}{}, {} triangles, {:.0f} ms; check {}\n{}", options.folder,
                             counts_of(centrelines), linked(centrelines), surface.triangles.size(), total_ms,
                             (folder / "report.png").string(), seg_note(scan, why_none)));
}

void segment(const SegmentArguments& options, Session& session) {
  const Stopwatch stopwatch;
  const SegmentOptions segmenting = parsed(options);
  std::optional<glm::dvec3> root_mm;
  if (!options.root.empty()) root_mm = parse_points({options.root}, "--root").front();
  check_folder(options.folder,
               {"mask.nrrd", "lumen.nrrd", kSegName, "tree.vtp", "tree.json", "surface.vtp", "surface.stl",
                "report.png"},
               "-o " + options.folder);
  const Scan scan = open_scan(options.input, options.scan, session.progress);
  session.say_about(scan.info);
  const Volume volume = collect(*scan.source, session.progress, options.input);
  session.say_about(*scan.source);
  const Findings found = findings_in(volume, segmenting, options, root_mm, session);
  write_findings(found, scan.info, volume, segmenting, options);
  report_findings(found, scan.info, options, stopwatch.ms(), session);
}

}  // namespace

void add_segment(CLI::App& app, Session& session) {
  const auto options = std::make_shared<SegmentArguments>();
  CLI::App* command = add_command(
      app, session, "segment", "Segment the vessels of a CT angiography: mask, centrelines and surface",
      "  xraycast segment cta.nii.gz -o vessels\n"
      "  xraycast segment cta.nii.gz -o aorta --seed 12.5,-170,690 --not 30,-200,640\n"
      "  xraycast segment cta.nii.gz -o vessels --window 200,600 --surface tubes\n"
      "  xraycast segment cta.nii.gz -o vessels --from-mask mine.nrrd",
      [options, &session] { segment(*options, session); });
  options->command = command;
  add_scan_argument(*command, options->input);
  command
      ->add_option(
          "-o,--output", options->folder,
          "Folder for the mask, the vessel tree, the surface and the report; for a DICOM series also "
          "mask.seg.dcm, a DICOM Segmentation of its slices")
      ->required()
      ->type_name("DIR");
  command
      ->add_option("--seed", options->seeds,
                   "A point in a vessel to segment, mm (LPS); repeatable; without it, the largest vessels")
      ->type_name("X,Y,Z");
  command
      ->add_option("--not", options->not_vessels,
                   "A point in a structure to exclude, such as a vein that touches an artery; repeatable")
      ->type_name("X,Y,Z");
  command
      ->add_option("--max-radius", options->segment.markers.max_radius_mm,
                   "Largest radius of a vessel; a structure in which a larger sphere fits is excluded as a "
                   "heart chamber")
      ->capture_default_str()
      ->type_name("MM");
  command
      ->add_option("--window", options->window,
                   "Range of CT numbers of the vessels in HU; auto: from the histogram")
      ->capture_default_str()
      ->type_name("auto|LO,HI");
  command
      ->add_option("--explain", options->explain,
                   "Folder for the mask after each step, and a picture of what each step removed")
      ->type_name("DIR");
  command
      ->add_option("--from-mask", options->from_mask, "Start from a mask of the vessels, on the scan's grid")
      ->excludes("--explain")
      ->type_name("MASK");
  command
      ->add_option("--root", options->root,
                   "The tree's root is the vessel end nearest to this point, mm (LPS); without it, the end "
                   "of the widest vessel")
      ->type_name("X,Y,Z");
  command
      ->add_option("--surface", options->surface,
                   "level-set: isosurface of the smoothed mask; tubes: swept along the centrelines")
      ->check(CLI::IsMember({"level-set", "tubes"}))
      ->capture_default_str()
      ->type_name("KIND");
  command->add_option("--triangles", options->triangles, "Approximate number of triangles of the surface")
      ->capture_default_str()
      ->type_name("N");
  add_scan_options(*command, options->scan);
}

}  // namespace xraycast::cli
