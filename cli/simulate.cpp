#include "options/angiography_options.hpp"
#include "options/command.hpp"
#include "options/exercise_options.hpp"
#include "options/fluoroscope_options.hpp"
#include "options/heart_options.hpp"
#include "options/motion_options.hpp"
#include "options/run_options.hpp"
#include "options/scene_options.hpp"
#include "options/view_options.hpp"
#include "xraycast/acquisition/frame_file.hpp"
#include "xraycast/acquisition/run_cine.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/contrast_agent/agent_outlet.hpp"
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/reports/hub_plot.hpp"
#include "xraycast/reports/pressure_plot.hpp"
#include "xraycast/reports/run_comparison.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"
#include "xraycast/scene/vessels.hpp"
#include "xraycast/simulation/run.hpp"
#include "xraycast/simulation/run_monitor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>

namespace xraycast::cli {
namespace {

namespace fs = std::filesystem;

struct SimulateArguments {
  std::string tree, log, plot, pressure_plot, exercise, report;
  RunOptions run;
  std::string map, cine, look = "fluoro";
  std::vector<std::string> objects;
  InjectionOptions injection;
  HeartOptions heart;
  SubtractionOptions subtraction;
  ViewOptions view;
  DicomOptions dicom;
  FluoroscopeArguments fluoroscope;
  const CLI::App* command = nullptr;
};

/// forces.png, forces-2.png and so on, one an instrument; none without --plot.
std::vector<fs::path> plots_of(const SimulateArguments& options) {
  if (options.plot.empty()) return {};
  std::vector<fs::path> paths{options.plot};
  for (std::size_t d = 2; d <= options.run.instrument_models.size(); ++d)
    paths.push_back(paths[0].parent_path() /
                    fmt::format("{}-{}{}", paths[0].stem().string(), d, paths[0].extension().string()));
  return paths;
}

/// Throws InputError for what is no patient, or applies to no DICOM file.
XaOptions parse_xa(const SimulateArguments& options) {
  return parse_xa(options.dicom, options.cine.empty() ? "a run without --cine" : options.cine);
}

/// One line for a run, of a fluoroscope or as DICOM, that shows no vessels.
void note_on_vessels(const Injection& injection, const Invocation& invocation) {
  if (injection.volume_ml() == 0)
    invocation.say(
        {"the run shows no vessels without contrast agent: add --inject FROM_S,TO_S to opacify them"});
}

/// How --cine shows the run.
PictureOptions picture_of(const SimulateArguments& options) {
  PictureOptions picture;
  choose_look(options.look, picture);
  picture.style.window.inverted = picture.style.look == Look::surface;
  picture.acquisition.fluoroscope = parse_fluoroscope(options.fluoroscope);
  picture.acquisition.mask_shift = parse_mask_shift(options.subtraction);
  picture.acquisition.shows_maximum_opacification = options.subtraction.shows_maximum_opacification;
  check(picture, true, true);
  return picture;
}

/// The same in a body that moves, at whose phases masks are taken.
PictureOptions picture_with_masks(const SimulateArguments& options, const BodyRequest& body) {
  PictureOptions picture = picture_of(options);
  picture.acquisition.mask_matching = matching_of(options.subtraction, body.motion.get());
  return picture;
}

View view_of(const SimulateArguments& options, const BodyBounds& bounds) {
  View view = on_c_arm(options.fluoroscope.request, parse_view(options.view));
  view.centre_mm = isocentre_mm(options.view, bounds);
  const bool is_size_free = view.width == 0 && view.height == 0 && view.pixel_mm == 0;
  view = fitted(view, bounds);
  return is_size_free ? no_smaller(view, bounds) : view;
}

/// Draws the run into --cine while the catheter moves.
class Cine {
 public:
  Cine(const SimulateArguments& options, const RunRequest& request, const Invocation& invocation) {
    const VesselTree& tree = *request.tree;
    const double longest_s = request.script->rows().back().time_s;
    const auto map = std::make_shared<const BodyMap>(read_body_map(options.map));
    const BodyBounds bounds = bounds_of(map->geometry);
    invocation.say(notes_on_place(tree, bounds, options.tree));
    const std::vector<Implant> implants = open_objects(parse_objects(options.objects), invocation);
    const RunCine::Options cine{.view = view_of(options, bounds),
                                .picture = picture_with_masks(options, request.body),
                                .implants = surfaces_of(implants),
                                .injection = parse_injection(options.injection),
                                .black = parse_black(options.subtraction),
                                .blood = request.blood,
                                .body = request.body};
    if (request.body.motion && !map->keys)
      invocation.say(
          {"the map of --cine stands still; one by `xraycast cast --motion` without --phase and --time "
           "moves with the run"});
    const AcquisitionOptions& acquisition = cine.picture.acquisition;
    if (acquisition.fluoroscope || is_xa(options.cine)) note_on_vessels(cine.injection, invocation);
    if (acquisition.fluoroscope && !map->spectrum()) note_on_energies(invocation);
    XaOptions xa = parse_xa(options);
    xa.frame_of_reference_uid = frame_of_reference_for(xa.patient, map->frame_of_reference_uid);
    xa.is_subtracted = acquisition.subtracts;
    if (const auto& gate = request.body.gate) xa.scan_options = gate->mode == "heart" ? "EKG" : "PHY";
    if (is_xa(options.cine)) frame_of_reference_ = frame_of_reference_name(xa);
    check_dicom(cine.view, xa, options.cine, invocation);
    run_.emplace(map, tree, cine);
    file_.emplace(
        options.cine,
        FrameFile::Kind{
            .is_cine = true, .most_frames = run_->most_frames(longest_s), .frame_s = run_->options().step_s},
        cine.view, acquisition, xa);
  }

  void advance(const Instruments& instruments, double time_s) {
    if (!run_->advance(instruments, time_s)) return;
    if (file_->is_shown())
      file_->add(run_->picture());
    else
      file_->add_at(run_->instant(), run_->frame());
  }
  void finish() { file_->finish(exposure(), run_->acquisition().mask_frames()); }

  RunUse use() const { return run_->use(); }
  std::optional<ExposureRecord> exposure() const { return run_->acquisition().record(); }
  /// What is black in a subtraction's picture; none of other looks, and of DICOM, which is not yet
  /// subtracted.
  std::optional<double> black() const {
    if (!run_->options().picture.acquisition.subtracts || !file_->is_shown()) return std::nullopt;
    return run_->subtraction_black();
  }
  /// "scan" or "new"; empty where the cine is not DICOM.
  const std::string& frame_of_reference() const { return frame_of_reference_; }

 private:
  HeadlessContext context_;
  std::string frame_of_reference_;
  std::optional<RunCine> run_;
  std::optional<FrameFile> file_;
};

void check_cine(const SimulateArguments& options) {
  parse_xa(options);
  if (options.cine.empty()) {
    if (parse_fluoroscope(options.fluoroscope))
      throw InputError("the options of a fluoroscope apply to pictures of the run; add --cine and --map");
    return check_not_given(
        *options.command,
        {"--map", "--look", "--mask-shift", "--mask-phase", "--dsa-black", "--max-opacification", "--gate",
         "--angle", "--tilt", "--isocentre", "--cone", "--size", "--pixel"},
        "without pictures of the run; leave it out or give --cine too");
  }
  const PictureOptions picture = picture_of(options);
  const bool subtracts = picture.acquisition.subtracts;
  if (picture.acquisition.fluoroscope) check_linear_codes(options.dicom);
  if (options.map.empty())
    throw InputError("--cine {}: needs a body map to draw in; add --map MAP.exr", options.cine);
  const Injection injection = parse_injection(options.injection);
  if (subtracts && injection.volume_ml() == 0)
    throw InputError("--look dsa: there is no contrast agent to show; add --inject FROM_S,TO_S");
  check_subtraction(options.subtraction, subtracts, options.cine);
  parse_black(options.subtraction);
  if (is_animation(options.cine) || is_xa(options.cine)) return check_writable(options.cine);
  make_frames_folder(options.cine, "--cine " + options.cine);
  check_writable(fs::path(options.cine) / "frame-000.png");
}

Json json_of(const RunRecord& record, const VesselTree& tree) {
  const InstrumentTip& tip = record.tip;
  Json json{{"branch", tip.branch},
            {"vessel", tree.branches()[static_cast<std::size_t>(tip.branch)].name},
            {"arc_length_mm", tip.arc_length_mm},
            {"pressure_mmHg", record.pressure_mmHg},
            {"position_mm", {tip.position_mm.x, tip.position_mm.y, tip.position_mm.z}}};
  if (record.phases.empty()) return json;
  json["scan_mm"] = {tip.scan_mm.x, tip.scan_mm.y, tip.scan_mm.z};
  json["wall_work_J"] = record.wall_work_J;
  return json;
}

/// Where the tips ended, by a run's last records.
std::string text_of(const std::vector<RunRecord>& last, const VesselTree& tree) {
  std::string text;
  for (std::size_t d = 0; d < last.size(); ++d)
    text += fmt::format("{}: in {}, {:.0f} mm along it", d == 0 ? "tip" : fmt::format("; tip {}", d + 1),
                        tree.title(last[d].tip.branch), last[d].tip.arc_length_mm);
  return text;
}

Json json_of(const Run& run, const RunRequest& request, const SimulateArguments& options, double wall_s) {
  const VesselEnd& entry = run.entry;
  Json json{{"tree", options.tree},
            {"device_model", request.instruments[0].name()},
            {"entry_branch", entry.branch},
            {"entry_vessel", request.tree->branches()[static_cast<std::size_t>(entry.branch)].name},
            {"entry_mm", {entry.position_mm.x(), entry.position_mm.y(), entry.position_mm.z()}},
            {"entry_side", side_of_patient(*request.tree, entry)},
            {"held_s", run.held_s},
            {"log", options.log},
            {"rows", run.records.size()},
            {"simulated_s", run.last[0].time_s},
            {"wall_s", wall_s},
            {"tip", json_of(run.last[0], *request.tree)}};
  if (!run.modes.empty()) json["motion"] = request.body.motion->name();
  for (std::size_t m = 0; m < run.modes.size(); ++m) json["phases"][run.modes[m]] = run.last[0].phases[m];
  for (std::size_t d = 1; d < run.last.size(); ++d) {
    json[fmt::format("device_model_{}", d + 1)] = request.instruments[d].name();
    json[fmt::format("tip_{}", d + 1)] = json_of(run.last[d], *request.tree);
  }
  return json;
}

/// A run with all that was made while it went on.
struct Simulated {
  Run run;
  HubSamples samples;
  std::unique_ptr<Cine> cine;
  std::optional<RunMonitor> monitor;  ///< of an exercise, and for a report
  double wall_s = 0;
};

void check_outputs(const SimulateArguments& options) {
  check_writable(options.log);
  check_report_option(options.report);
  for (const fs::path& path : plots_of(options)) check_picture_name(path, "--plot " + path.string());
  if (!options.pressure_plot.empty())
    check_picture_name(options.pressure_plot, "--pressure-plot " + options.pressure_plot);
  check_cine(options);
}

RunRequest request_of(const SimulateArguments& options, const std::optional<Exercise>& exercise) {
  RunRequest request = parse_run(options.run, options.tree);
  request.blood = parse_heart(options.heart);
  if (exercise) apply(*exercise, options.run, request);
  request.injection = parse_injection(options.injection);
  return request;
}

Simulated simulated(const SimulateArguments& options, const RunRequest& request,
                    const std::optional<Exercise>& exercise, Invocation& invocation) {
  const Stopwatch stopwatch;
  Simulated done{.run = {}, .samples = HubSamples(*request.script), .cine = {}, .monitor = {}};
  if (!options.cine.empty()) done.cine = std::make_unique<Cine>(options, request, invocation);
  const bool is_monitored = exercise || !options.report.empty();
  RunUse use;
  done.run = xraycast::run(request, invocation.progress,
                           [&](const Instruments& moved, double time_s, const InstrumentPressures& blood) {
                             if (!options.plot.empty()) done.samples.record(moved, time_s);
                             if (done.cine) done.cine->advance(moved, time_s);
                             if (!is_monitored) return;
                             use = with_blood(done.cine ? done.cine->use() : RunUse{}, request, blood);
                             if (!done.monitor)
                               done.monitor.emplace(moved, names_of(request.instruments),
                                                    progress_of(exercise, *request.tree));
                             else
                               done.monitor->add(moved, use);
                           });
  done.wall_s = 1e-3 * stopwatch.ms();
  if (done.monitor && !done.run.embolised.empty()) {
    use.embolised = done.run.embolised;
    done.monitor->use(use);
  }
  return done;
}

void write_outputs(const SimulateArguments& options, const RunRequest& request, Simulated& done) {
  OutputSet outputs;
  write_whole_file(options.log, to_csv(done.run));
  const std::vector<fs::path> plots = plots_of(options);
  for (std::size_t d = 0; d < plots.size(); ++d)
    write_picture(hub_plot(request.instruments[d].name() + ": at the hub", done.samples.records(), d),
                  plots[d]);
  if (!options.pressure_plot.empty())
    write_picture(pressure_plot(done.run, names_of(request.instruments)), options.pressure_plot);
  if (done.cine) done.cine->finish();
  if (!options.report.empty()) write_report(options.report, done.monitor->json(true));
  outputs.commit();
}

Json json_of(const Simulated& done, const RunRequest& request, const SimulateArguments& options) {
  Json json = json_of(done.run, request, options, done.wall_s);
  if (done.cine && !done.cine->frame_of_reference().empty())
    json["frame_of_reference"] = done.cine->frame_of_reference();
  if (const auto black = done.cine ? done.cine->black() : std::nullopt) json["dsa_black"] = *black;
  if (done.monitor) json["report"] = Json::parse(done.monitor->json(false));
  for (const Embolised& embolised : done.run.embolised)
    json["embolised"].push_back({{"branch", embolised.branch},
                                 {"vessel", embolised.vessel},
                                 {"particles", embolised.particles},
                                 {"periphery_percent", 100 * embolised.open_share}});
  if (const auto exposure = done.cine ? done.cine->exposure() : std::nullopt)
    json["fluoroscope"] = to_json(*exposure);
  if (!options.injection.times.empty()) {
    json["injected_ml"] = done.run.injected_ml;
    json["withheld_ml"] = done.run.withheld_ml;
  }
  return json;
}

/// What a run did besides, a line each: notes, exercise, treatments, dose, and the files.
std::string lines_of(const Simulated& done, const RunRequest& request, const SimulateArguments& options) {
  const Run& run = done.run;
  std::string lines;
  const auto add = [&](const std::string& line) { lines += line + "\n"; };
  for (const std::string& note : run.notes) add(note);
  if (done.monitor && done.monitor->progress()) add(in_words(*done.monitor->progress()));
  for (const Treatment& treatment : run.treatments) add(in_words(treatment, *request.tree));
  for (const Coiling& coiling : run.coilings) add(in_words(coiling));
  constexpr std::size_t kMostShown = 12;
  for (const Embolised& embolised : most_first(run.embolised, kMostShown)) add(in_words(embolised));
  if (const auto exposure = done.cine ? done.cine->exposure() : std::nullopt) lines += summary(*exposure);
  if (const auto black = done.cine ? done.cine->black() : std::nullopt)
    add(fmt::format(
        "subtraction: an optical depth of {:.3g} is black; films to compare with this one take it by "
        "--dsa-black {}",
        *black, *black));
  for (const fs::path& file : plots_of(options)) add(fmt::format("{}: written", file.string()));
  for (const std::string& file : {options.pressure_plot, options.cine, options.report})
    if (!file.empty()) add(fmt::format("{}: written", file));
  return lines;
}

void simulate(SimulateArguments options, Invocation& invocation) {
  const std::optional<Exercise> exercise =
      parse_exercise_option(*options.command, options.exercise, options.tree, options.run);
  if (exercise) take_reference(*exercise, options.exercise, options.run);
  check_outputs(options);
  const RunRequest request = request_of(options, exercise);
  invocation.say(check(request));
  if (request.body.motion) invocation.say(request.body.motion->warnings());

  Simulated done = simulated(options, request, exercise, invocation);
  write_outputs(options, request, done);
  const double simulated_s = done.run.last[0].time_s;
  invocation.report(
      json_of(done, request, options),
      fmt::format("{}: {}, {:.1f} s simulated in {:.1f} s ({:.1f} times real time)\n"
                  "entry: end of {}; {}\n{}",
                  options.log, pluralize(done.run.records.size(), "row"), simulated_s, done.wall_s,
                  simulated_s / std::max(done.wall_s, 1e-9), text_of(*request.tree, done.run.entry),
                  text_of(done.run.last, *request.tree), lines_of(done, request, options)));
}

}  // namespace

void add_simulate(CLI::App& app, Invocation& invocation) {
  const auto options = std::make_shared<SimulateArguments>();
  CLI::App* command = add_command(
      app, invocation, "simulate", "Steer a catheter through a vessel tree with a script, without a display",
      "  xraycast simulate vessels/tree.vtp --device-model cobra-5f --script push.csv -o log.csv\n"
      "  xraycast simulate vessels/tree.vtp --device-model guidewire-035-j --script push.csv -o log.csv \\\n"
      "    --entry 19 --plot forces.png\n"
      "  xraycast simulate vessels --device-model cobra-5f --script push.csv -o log.csv --map map.exr \\\n"
      "    --cine run.gif --inject 8,9 --size 480x640\n"
      "  xraycast simulate vessels --device-model cobra-5f --script push.csv -o log.csv --map map.exr \\\n"
      "    --cine run.dcm --inject 8,9 --cone 780,1200 --patient Phantom,1\n"
      "  xraycast simulate vessels --device-model cobra-5f --script push.csv -o log.csv --map map.exr \\\n"
      "    --cine dsa.gif --look dsa --inject 8 --injection-rate 6 --injection-volume 12 --iodine 300\n"
      "  xraycast simulate vessels --device-model cobra-5f --device-model guidewire-035-j \\\n"
      "    --script both.csv -o log.csv\n"
      "  xraycast simulate vessels --device-model guidewire-014-angled --script push.csv -o log.csv \\\n"
      "    --motion thorax-motion/motion.json --phase breath=0\n"
      "  xraycast simulate vessels --device-model cobra-5f --script push.csv -o log.csv --map moving.exr \\\n"
      "    --cine gated.gif --motion thorax-motion/motion.json --gate heart=0.75\n"
      "  xraycast simulate thorax-truth --exercise examples/exercises/1-left-renal.json -o log.csv \\\n"
      "    --report run.html\n"
      "A script is a CSV file: time_s,insertion_mm,rotation_deg in its first line, then numbers; with a\n"
      "second instrument also insertion_2_mm,rotation_2_deg. Insertions are counted from the introducer. "
      "Balloons,\n"
      "such as that of balloon-6x20, have the columns inflation_bar and inflation_2_bar; stents that open\n"
      "themselves, such as that of stent-self-8x40, have release_mm and release_2_mm: how far the sheath is\n"
      "drawn back; wires that push coils, such as coil-10x30 in microcatheter-24f, have detach_2: how many "
      "coils\n"
      "were to be detached so far.",
      [options, &invocation] { simulate(*options, invocation); });
  options->command = command;
  command->add_option("TREE", options->tree, "The vessel tree (.vtp or .json), or a folder with one")
      ->required()
      ->type_name("TREE");
  add_coaxial_options(*command, options->run);
  add_script_option(*command, options->run, "Motion of the hub, interpolated linearly between rows")
      ->required();
  command
      ->add_option("-o,--output", options->log,
                   "The log: one row per row of the script, with the hub's force in N and torque in N m, and "
                   "the blood's "
                   "pressure at the tip in mmHg")
      ->required()
      ->type_name("CSV");
  add_exercise_option(*command, options->exercise,
                      "A task whose progress is counted (docs/exercises.md). Its instruments, entry and "
                      "reference run are those of --device-model, --entry and --script where these are not "
                      "given");
  add_report_option(*command, options->report, "What the instruments did");
  add_body_options(
      *command, options->run.body,
      "How the body moves about the instruments: a motion.json of displacement fields, whose 0 s are "
      "those of the script; the tree is that of the scan",
      true);
  command->add_option("--plot", options->plot, "Plot the hub's force and torque over time")
      ->type_name("IMAGE");
  command
      ->add_option("--pressure-plot", options->pressure_plot,
                   "Plot the pressure of the blood at the tips and in the aorta over time")
      ->type_name("IMAGE");
  add_object_option(*command, options->objects);
  command->add_option("--map", options->map, "The body map in which --cine is drawn")->type_name("MAP.exr");
  command
      ->add_option(
          "--cine", options->cine,
          "Frames of the run, ten per second, or a fluoroscope's pulses: a folder of PNGs, a .gif, or a .dcm "
          "(DICOM XA)")
      ->type_name("DIR|GIF|DCM");
  command
      ->add_option(
          "--look", options->look,
          "--cine: the catheter attenuates X-rays (fluoro) or is shaded (surface); dsa: digital subtraction "
          "angiography, which begins 0.5 s before --inject with the frames of the mask image")
      ->check(CLI::IsMember({"fluoro", "surface", "dsa"}))
      ->capture_default_str()
      ->type_name("NAME");
  add_injection_options(*command, options->injection);
  add_heart_options(*command, options->heart);
  add_subtraction_options(*command, options->subtraction);
  add_view_options(*command, options->view);
  add_dicom_options(*command, options->dicom);
  add_fluoroscope_options(*command, options->fluoroscope);
}

}  // namespace xraycast::cli
