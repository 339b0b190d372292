#include "embedded_scripts.hpp"
#include "options/command.hpp"
#include "xraycast/acquisition/run_cine.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/image.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/drawing/brightness.hpp"
#include "xraycast/drawing/cine_writer.hpp"
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/drawing/renderer.hpp"
#include "xraycast/export/export_request.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/projection/projection_file.hpp"
#include "xraycast/reports/contact_sheet.hpp"
#include "xraycast/reports/hub_plot.hpp"
#include "xraycast/reports/index_page.hpp"
#include "xraycast/reports/map_preview.hpp"
#include "xraycast/reports/vessel_report.hpp"
#include "xraycast/requests/cast_request.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"
#include "xraycast/scan/scan.hpp"
#include "xraycast/scene/vessels.hpp"
#include "xraycast/segmentation/vessels.hpp"
#include "xraycast/simulation/run.hpp"
#include "xraycast/volume/body_outline.hpp"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <numbers>
#include <numeric>

namespace xraycast::cli {
namespace {

namespace fs = std::filesystem;

/// Collects the demo's pictures and the time of each step.
class Report {
 public:
  Report(fs::path folder, const Invocation& invocation)
      : folder_(std::move(folder)), invocation_(invocation) {}

  fs::path file(const std::string& name) const { return folder_ / name; }

  /// Runs a step and records its time.
  template <typename Step>
  auto timed(const std::string& what, const Step& step) {
    const auto start = std::chrono::steady_clock::now();
    auto result = step();
    const double s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    note(what, s < 1 ? fmt::format("{:.0f} ms", 1000 * s) : fmt::format("{:.1f} s", s));
    return result;
  }

  void note(const std::string& name, const std::string& value) {
    facts_.emplace_back(name, value);
    invocation_.say({fmt::format("{:<44}{}", name, value)});
  }

  void picture(const std::string& name, const std::string& caption) {
    pictures_.push_back({file(name), caption});
  }

  /// `name`.png, a still of `name`.gif.
  void cine(const std::string& name, const std::string& caption) {
    pictures_.push_back({file(name + ".png"), fmt::format("{}.gif: {}", name, caption), file(name + ".gif")});
  }

  void finish() const {
    write_picture(contact_sheet(pictures_, 4), file("contact-sheet.png"));
    write_index_page("xraycast: from a CT scan to body maps",
                     {file("run.html"), "The catheter's run as a page of its own: drag to turn, press Play"},
                     pictures_, facts_, file("index.html"));
  }

 private:
  fs::path folder_;
  const Invocation& invocation_;
  std::vector<CaptionedPicture> pictures_;
  std::vector<std::pair<std::string, std::string>> facts_;
};

constexpr int kFrameLayers = 32;  // with fewer, ribs are blurred

// Frames are placed below the true projections of the same angles. Both are collimated to the scan's field of
// view, beyond whose sides the arms reach: they would end there in straight edges.
constexpr std::array kAngles_deg{0.0, 45.0, 90.0, -30.0};

BodyMap make_map(const SpectralScan& scan, const OutlineFinder& body, const CastRequest& request,
                 Report& report, Progress& progress) {
  BodyMap map =
      report.timed(fmt::format("cast of {}, 360 angles", pluralize(request.layers.value_or(1), "layer")),
                   [&] { return cast(request, scan, body, {}, progress).map; });
  map.source = "thorax phantom";
  const std::string name = fmt::format("map-{}", map.geometry.layers());
  write_body_map(map, report.file(name + ".exr"));
  write_picture(map_preview(map, PreviewWindow::automatic), report.file(name + ".png"));
  return map;
}

void show_inner_layers(const BodyMap& map, Report& report) {
  const MapGeometry& geometry = map.geometry;
  const auto radius_mm = [&](int k) { return geometry.radii_mm[static_cast<std::size_t>(k)]; };
  for (const int k : {0, 1, 2}) {
    const std::string name = fmt::format("map-{}-layer-{}.png", geometry.layers(), k);
    write_picture(windowed_transmission(map.layer(k)), geometry.width, geometry.height, 1, report.file(name));
    report.picture(name, fmt::format("Layer {} of {}: {:.0f} to {:.0f} mm from the axis", k + 1,
                                     geometry.layers(), radius_mm(k), radius_mm(k + 1)));
  }
}

void make_projection(const ResidentScan& scan, const BodyOutline& body, double angle_deg, Report& report,
                     Progress& progress) {
  const VolumeGeometry& volume = scan.geometry();
  View view;
  view.lao_rad = angle_deg * std::numbers::pi / 180;
  view.cone = Cone{1000, 1500};
  view.centre_mm = {body.centre_mm, 0.5 * (volume.lower_mm().z + volume.upper_mm().z)};
  view.centre_mm.z += 70;  // the chest
  view.width = 480;
  view.height = 600;
  view.pixel_mm = 1.2;
  const ProjectionImage image = report.timed("true projection, " + label(view), [&] {
    return project(scan, fitted(view, volume, body), Opacity::paper(), progress);
  });
  const std::string name = fmt::format("projection-{:.0f}.png", angle_deg);
  write_projection(image, report.file(name));
  report.picture(name, "True projection, " + label(view));
}

/// Frames of a body map around the body, with the phantom's vessels in both looks.
void make_frames(const Phantom& phantom, const std::shared_ptr<const BodyMap>& map, Report& report) {
  const HeadlessContext context;
  report.note("OpenGL device", gl_device_name());
  Renderer renderer;
  renderer.set_map(map);
  Surface vessels{tube_mesh(VesselTree(phantom.vessel_branches(), "thorax phantom"))};
  vessels.mu_per_mm = 0.01;
  renderer.set_surfaces(std::span(&vessels, 1));
  CArmPose pose{.table_mm = 70, .zoom = 1.55};
  for (const Look look : {Look::fluoro, Look::surface})
    for (const double angle_deg : kAngles_deg) {
      pose.lao_rad = angle_deg * std::numbers::pi / 180;
      Style style;
      style.look = look;
      style.window.inverted = look == Look::surface;
      const View view = view_of(pose, bounds_of(map->geometry), 480, 600);
      style.window = automatic_window(renderer, view, style);
      const std::string name = fmt::format("frame-{}-{:.0f}.png", to_string(look), angle_deg);
      const std::vector<std::uint8_t> rgb =
          report.timed(fmt::format("frame, {}, {}", to_string(look), label(view)),
                       [&] { return renderer.picture(view, style); });
      write_picture(rgb, view.width, view.height, 3, report.file(name));
      report.picture(name, fmt::format("Frame of {} layers, {}, {}", map->geometry.layers(), to_string(look),
                                       label(view)));
    }
}

/// The phantom's vessels as segmentation finds them, in `vessels`.
VesselTree segment_phantom(const Volume& volume, ComputeDevice& device, Report& report, Progress& progress) {
  const std::string name = "thorax phantom";
  SegmentRequest request;
  request.surface = SurfaceKind::tubes;
  const Vessels vessels = report.timed("vessels segmented",
                                       [&] { return find_vessels(volume, request, name, device, progress); });
  write_vessels(vessels, {}, request.is_automatic(), report.file("vessels"), progress);
  write_picture(vessel_report(name, vessels, request, volume), report.file("vessels/report.png"));
  report.picture("vessels/report.png", "Vessels: mask and tree over the scan");
  return vessels.centrelines.tree;
}

/// A body map without the vessels, in which a catheter's run is drawn.
std::shared_ptr<const BodyMap> make_map_without_vessels(ComputeDevice& device, Report& report,
                                                        Progress& progress) {
  return report.timed("body map without the vessels", [&] {
    const auto open = [&](Progress& opening) { return open_scan(report.file("thorax.nrrd"), {}, opening); };
    const CastRequest request{.layers = kFrameLayers, .without_vessels = report.file("vessels")};
    auto map = std::make_shared<BodyMap>(cast(request, open, device, progress).map);
    map->source = "thorax phantom without vessels";
    write_body_map(*map, report.file("map-without-vessels.exr"));
    return std::shared_ptr<const BodyMap>(map);
  });
}

// From the left groin up the aorta into the left renal artery; then contrast agent is injected.
constexpr const char* kScript = "time_s,insertion_mm,rotation_deg\n0,0,0\n8,375,0\n10.5,375,0\n";
constexpr Injection kSelective{.from_s = 8.5, .to_s = 11};

// To above both renal arteries; 20 ml by a power injector fill them with the aorta.
constexpr const char* kFlushScript = "time_s,insertion_mm,rotation_deg\n0,0,0\n4,412,0\n7.5,412,0\n";
constexpr Injection kFlush{.from_s = 4.5, .to_s = 4.5 + 20.0 / 15, .rate_ml_s = 15};

double darkness(const std::vector<std::uint8_t>& rgb) {
  return -std::accumulate(rgb.begin(), rgb.end(), 0.0);
}

/// The run as a page for browsers.
void write_run_page(const VesselTree& tree, const std::shared_ptr<const BodyMap>& map, RecordedRun run,
                    const Report& report) {
  ExportRequest page;
  page.title = "A catheter on its way into the left renal artery of the thorax phantom";
  page.map = map;
  page.vessels = filled_vessels(tube_mesh(tree), kUsualContrast_mg_ml);
  page.run = std::move(run);
  page.pose = {.table_mm = -100, .zoom = 1.6};
  page.still_png = read_whole_file(report.file("run-fluoro.png"));
  write_whole_file(report.file("run.html"), export_bytes(page));
}

/// A cine of a run, with a still of it.
struct CineWithStill {
  CineWithStill(const std::shared_ptr<const BodyMap>& map, const VesselTree& tree,
                const RunCine::Options& options, const fs::path& name)
      : run(map, tree, options),
        writer(name.string() + ".gif", options.view.width, options.view.height),
        still_file(name.string() + ".png") {}

  /// The still is the last frame, of subtraction the one with most contrast agent.
  void advance(const Instruments& instruments, double time_s) {
    if (!run.advance(instruments, time_s)) return;
    std::vector<std::uint8_t> rgb = run.picture();
    writer.add(rgb);
    const bool subtracts = run.options().picture.acquisition.subtracts;
    if (!subtracts || still.empty() || darkness(rgb) > darkness(still)) still = std::move(rgb);
  }
  void finish() {
    writer.finish();
    write_picture(still, run.options().view.width, run.options().view.height, 3, still_file);
  }

  RunCine run;
  CineWriter writer;
  fs::path still_file;
  std::vector<std::uint8_t> still;
};

/// A catheter's run by the script, as cines in both looks, with the loads at the hub.
void make_run(const std::shared_ptr<const VesselTree>& tree, const std::shared_ptr<const BodyMap>& map,
              Report& report, Progress& progress) {
  const HeadlessContext context;
  RunCine::Options options;
  options.view =
      fitted({.centre_mm = bounds_of(map->geometry).centre_mm, .width = 360, .height = 450, .pixel_mm = 0.7},
             bounds_of(map->geometry));
  options.view.centre_mm.z -= 100;  // the abdomen, as narrow as a fluoroscope's field
  options.injection = kSelective;
  std::vector<std::unique_ptr<CineWithStill>> cines;
  for (const char* look : {"fluoro", "surface"}) {
    choose_look(look, options.picture);
    options.picture.style.window.inverted = options.picture.style.look == Look::surface;
    cines.push_back(
        std::make_unique<CineWithStill>(map, *tree, options, report.file(fmt::format("run-{}", look))));
  }

  // The script turns the Cobra for the way from the left groin.
  const RunRequest request{.tree = tree,
                           .entry = {glm::dvec3(89, -54, -357)},
                           .script = Script::parse(kScript, "demo"),
                           .interval_s = 0.02};
  RecordedRun recorded = RecordedRun::of(request.instruments);
  const Run run = report.timed("catheter run of 10.5 s, with its frames", [&] {
    return xraycast::run(request, progress,
                         [&](const Instruments& moved, double time_s, const InstrumentPressures&) {
                           for (const auto& cine : cines) cine->advance(moved, time_s);
                           recorded.record(moved, time_s);
                         });
  });
  for (const auto& cine : cines) cine->finish();
  report.note("tip of the catheter",
              fmt::format("in {}, {:.0f} mm along it", tree->title(run.last[0].tip.branch),
                          run.last[0].tip.arc_length_mm));
  report.cine("run-fluoro", "Cobra to the left renal artery");
  report.cine("run-surface", "the same run");
  write_picture(hub_plot("Cobra 5 F: force and torque at the hub", run.records, 0),
                report.file("run-forces.png"));
  report.picture("run-forces.png", "Force and torque at the hub");
  write_run_page(*tree, map, std::move(recorded), report);
}

/// Contrast agent from a pigtail in the aorta into both renal arteries, as subtraction angiography.
void make_angiography(const std::shared_ptr<const VesselTree>& tree,
                      const std::shared_ptr<const BodyMap>& map, Report& report, Progress& progress) {
  const HeadlessContext context;
  RunCine::Options options;
  options.injection = kFlush;
  options.view = fitted({.centre_mm = {5, -10, -85}, .width = 360, .height = 450, .pixel_mm = 0.5},
                        bounds_of(map->geometry));  // from the renal arteries to the bifurcation
  choose_look("dsa", options.picture);
  options.picture.acquisition.fluoroscope = {
      .c_arm = CArm::named("fixed-single-plane"), .dose = DoseLevel::cine, .pulses_per_s = 10};
  CineWithStill cine(map, *tree, options, report.file("run-dsa"));
  const RunRequest request{.tree = tree,
                           .instruments = instruments_named({"pigtail-5f"}),
                           .entry = {glm::dvec3(89, -54, -357)},
                           .script = Script::parse(kFlushScript, "demo")};
  report.timed("angiography of the renal arteries", [&] {
    return run(request, progress, [&](const Instruments& moved, double time_s, const InstrumentPressures&) {
      cine.advance(moved, time_s);
    });
  });
  cine.finish();
  report.cine("run-dsa", "DSA, 20 ml into the aorta");
}

/// A wire steered from the right groin into the left carotid artery, and the catheter over it.
void make_steering(const std::shared_ptr<const VesselTree>& tree, const std::shared_ptr<const BodyMap>& map,
                   Report& report, Progress& progress) {
  const HeadlessContext context;
  const BodyBounds bounds = bounds_of(map->geometry);
  RunCine::Options options;
  options.view =
      fitted({.centre_mm = bounds.centre_mm, .width = 248, .height = 450, .pixel_mm = 1.6}, bounds);
  options.step_s = 0.2;
  CineWithStill cine(map, *tree, options, report.file("carotid"));
  const EmbeddedFile& script = embedded_scripts().front();
  const RunRequest request{.tree = tree,
                           .instruments = instruments_named({"vertebral-5f", "guidewire-035-angled"}),
                           .entry = {glm::dvec3(-89, -54, -357)},
                           .script = Script::parse(std::string(script.source), std::string(script.name), 2)};
  report.timed("wire and catheter to the carotid artery", [&] {
    return run(request, progress, [&](const Instruments& moved, double time_s, const InstrumentPressures&) {
      cine.advance(moved, time_s);
    });
  });
  cine.finish();
  report.cine("carotid", "a wire, then the catheter");
}

void run_demo(const std::string& folder, Invocation& invocation) {
  make_folder(folder, folder);
  const OutputSeries files;
  Report report(folder, invocation);
  Progress& progress = invocation.progress;

  ComputeDevice device(invocation.device);
  report.note("OpenCL device", device.info().name);
  const Phantom phantom = make_phantom("thorax");
  const Volume volume =
      report.timed("thorax phantom, 512 x 512 x 720", [&] { return generate(phantom, device, progress); });
  report.timed("thorax phantom written", [&] {
    write_volume(volume, report.file("thorax.nrrd"), progress);
    return 0;
  });
  OutlineFinder body(volume.geometry(), {.finds_skin = true});
  body.add(volume.hu());
  const SpectralScan scan{report.timed("scan uploaded to the device", [&] { return upload(device, volume); }),
                          {}};
  make_map(scan, body, {.layers = 1}, report, progress);
  report.picture("map-1.png", "Body map, one layer");
  // Circles are what a map's layers look best by; frames, of shells that follow the body.
  show_inner_layers(make_map(scan, body, {.layers = 8, .outline = ShellOutline::circle}, report, progress),
                    report);
  const auto layered =
      std::make_shared<const BodyMap>(make_map(scan, body, {.layers = kFrameLayers}, report, progress));
  for (const double angle_deg : kAngles_deg)
    make_projection(scan.native, body.finish(), angle_deg, report, progress);
  make_frames(phantom, layered, report);
  const auto tree = std::make_shared<const VesselTree>(segment_phantom(volume, device, report, progress));
  const auto without_vessels = make_map_without_vessels(device, report, progress);
  make_run(tree, without_vessels, report, progress);
  make_angiography(tree, without_vessels, report, progress);
  make_steering(tree, without_vessels, report, progress);
  report.finish();
  invocation.report(
      {{"folder", folder}},
      fmt::format("Wrote {0}/contact-sheet.png and {0}/index.html: open either to see the results.\n",
                  folder));
}

}  // namespace

void add_demo(CLI::App& app, Invocation& invocation) {
  const auto folder = std::make_shared<std::string>("demo");
  CLI::App* command =
      add_command(app, invocation, "demo", "Run the whole pipeline on the built-in phantom",
                  "  xraycast demo -o demo", [folder, &invocation] { run_demo(*folder, invocation); });
  command->add_option("-o,--output", *folder, "Folder for all results")
      ->capture_default_str()
      ->type_name("DIR");
}

}  // namespace xraycast::cli
