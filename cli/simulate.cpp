#include "catheter_options.hpp"
#include "command.hpp"
#include "pictures/hub_plot.hpp"
#include "pictures/plot.hpp"
#include "pictures/run_report.hpp"
#include "view_options.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/drawing/cine_writer.hpp"
#include "xraycast/drawing/headless_context.hpp"
#include "xraycast/drawing/run_cine.hpp"
#include "xraycast/sampling/camera.hpp"
#include "xraycast/scene/vessels.hpp"
#include "xraycast/simulation/run_script.hpp"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>

namespace xraycast::cli {
namespace {

namespace fs = std::filesystem;

struct SimulateArguments {
  std::string tree, script, log, plot, entry;
  std::vector<std::string> instrument_models;
  std::string map, cine, look = "fluoro", inject;
  ViewOptions view;
  DicomOptions dicom;
};

/// FROM,TO in seconds. Throws InputError.
std::pair<double, double> parse_injection(const std::string& text) {
  if (text.empty()) return {0, 0};
  const std::vector<double> times_s = parse_numbers(text, "--inject");
  if (times_s.size() != 2 || !(0 <= times_s[0] && times_s[0] < times_s[1]))
    throw InputError("--inject {}: must be FROM,TO in seconds", text);
  return {times_s[0], times_s[1]};
}

/// Throws InputError for what is no patient, or applies to no DICOM file.
XaOptions parse_xa(const SimulateArguments& options) {
  return parse_xa(options.dicom, options.cine.empty() ? "a run without --cine" : options.cine);
}

/// Draws the run into --cine while the catheter moves.
class Cine {
 public:
  Cine(const SimulateArguments& options, const VesselTree& tree, double longest_s, const Session& session) {
    const auto map = std::make_shared<const BodyMap>(read_body_map(options.map));
    RunCine::Options cine;
    cine.view = parse_view(options.view);
    const BodyBounds bounds = bounds_of(map->geometry);
    session.say(notes_on_place(points_of(tree), bounds, options.tree));
    cine.view.centre_mm = bounds.centre_mm;
    const bool is_size_free = cine.view.width == 0 && cine.view.height == 0 && cine.view.pixel_mm == 0;
    cine.view = fitted(cine.view, bounds);
    if (is_size_free) cine.view = no_smaller(cine.view, bounds);
    cine.style.shading = parse_shading_mode(options.look);
    cine.style.window.inverted = cine.style.shading == ShadingMode::surface;
    std::tie(cine.inject_from_s, cine.inject_to_s) = parse_injection(options.inject);
    if (is_xa(options.cine))
      start_xa(options, map, tree, cine, longest_s, session);
    else
      start(options, map, tree, cine);
  }
  template <class Devices>
  void see(const Devices& devices, double time_s) {
    run_->see(devices, time_s);
  }
  void finish() {
    if (writer_) writer_->finish();
    if (xa_) xa_->finish();
  }
  /// "scan" or "new"; empty where the cine is not DICOM.
  const std::string& frame_of_reference() const { return frame_of_reference_; }

 private:
  void start(const SimulateArguments& options, const std::shared_ptr<const BodyMap>& map,
             const VesselTree& tree, const RunCine::Options& cine) {
    writer_.emplace(options.cine, cine.view.width, cine.view.height);
    run_.emplace(map, tree, cine, [this](const std::vector<std::uint8_t>& rgb) { writer_->add(rgb); });
  }

  void start_xa(const SimulateArguments& options, const std::shared_ptr<const BodyMap>& map,
                const VesselTree& tree, const RunCine::Options& cine, double longest_s,
                const Session& session) {
    XaOptions xa = parse_xa(options);
    xa.frame_time_ms = 1000 * cine.step_s;
    xa.frame_of_reference_uid = frame_of_reference_for(xa.patient, map->frame_of_reference_uid);
    frame_of_reference_ = frame_of_reference_name(xa);
    check_dicom(cine.view, xa, options.cine, session);
    const auto most_frames = static_cast<std::int64_t>(std::ceil(longest_s / cine.step_s)) + 1;
    xa_.emplace(options.cine, cine.view, most_frames, xa);
    run_.emplace(map, tree, cine,
                 [this, view = cine.view](const std::vector<float>& tau) { xa_->add(view, tau); });
  }

  HeadlessContext context_;
  std::optional<CineWriter> writer_;
  std::optional<XaWriter> xa_;
  std::string frame_of_reference_;
  std::optional<RunCine> run_;
};

void check_cine(const SimulateArguments& options) {
  parse_xa(options);
  if (options.cine.empty()) return;
  if (options.map.empty())
    throw InputError("--cine {}: needs a body map to draw in; add --map MAP.exr", options.cine);
  parse_injection(options.inject);
  if (is_animation(options.cine) || is_xa(options.cine)) return check_writable(options.cine);
  make_folder(options.cine, options.cine);
  check_writable(fs::path(options.cine) / "frame-000.png");
}

Json json_of(const CatheterTip& tip) {
  return {{"branch", tip.branch},
          {"arc_length_mm", tip.arc_length_mm},
          {"position_mm", {tip.position_mm.x, tip.position_mm.y, tip.position_mm.z}}};
}

/// Runs the script and writes what it leads to. `devices` is a Catheter or several, CoaxialCatheters.
template <class Devices>
void run(Devices& devices, const std::vector<InstrumentModel>& models, const VesselEnd& entry,
         const VesselTree& tree, const Script& script, const SimulateArguments& options, Session& session) {
  const Stopwatch stopwatch;
  std::optional<Cine> cine;
  if (!options.cine.empty()) cine.emplace(options, tree, script.rows().back().time_s, session);
  std::optional<HubPlot> plot;
  if (!options.plot.empty()) plot.emplace(script).see(records_of(devices, 0));
  double held_s = 0;
  const auto records =
      run_script(devices, script, options.script, session.progress, [&](const Devices& moved, double time_s) {
        if (plot) plot->see(records_of(moved, time_s));
        if (moved.is_held()) held_s += moved.step_s();
        if (cine) cine->see(moved, time_s);
      });
  const double wall_s = 1e-3 * stopwatch.ms();
  OutputSet outputs;
  write_whole_file(options.log, to_csv(records));
  if (plot) plot->write(models, options.plot);
  if (cine) cine->finish();
  outputs.commit();

  const std::vector<RunRecord> last = records_of(devices, devices.time_s());
  const double times_faster = devices.time_s() / std::max(wall_s, 1e-9);
  Json result{{"tree", options.tree},
              {"device_model", models[0].name()},
              {"entry_branch", entry.branch},
              {"held_s", held_s},
              {"log", options.log},
              {"rows", records.size()},
              {"simulated_s", devices.time_s()},
              {"wall_s", wall_s},
              {"tip", json_of(last[0].tip)}};
  for (std::size_t d = 1; d < models.size(); ++d) {
    result[fmt::format("device_model_{}", d + 1)] = models[d].name();
    result[fmt::format("tip_{}", d + 1)] = json_of(last[d].tip);
  }
  if (cine && !cine->frame_of_reference().empty()) result["frame_of_reference"] = cine->frame_of_reference();
  std::string pictures;
  for (const fs::path& file : HubPlot::paths(options.plot, models.size()))
    pictures += fmt::format("{}: written\n", file.string());
  if (!options.cine.empty()) pictures += fmt::format("{}: written\n", options.cine);
  session.report(result, fmt::format("{}: {}, {:.1f} s in {:.1f} s ({:.1f} times real time)\n"
                                     "entry: end of branch {}; {}\n{}{}",
                                     options.log, pluralize(records.size(), "row"), devices.time_s(), wall_s,
                                     times_faster, entry.branch, text_of(last), held_note(held_s), pictures));
}

void simulate(const SimulateArguments& options, Session& session) {
  check_writable(options.log);
  for (const fs::path& path : HubPlot::paths(options.plot, options.instrument_models.size()))
    check_plot(path);
  check_cine(options);
  const EntryChoice entry_choice = parse_entry(options.entry);
  std::vector<InstrumentModel> models;
  for (const std::string& name : options.instrument_models) models.push_back(InstrumentModel::named(name));
  check_devices(models);
  const Script script = Script::read(options.script, models.size());
  const VesselTree tree = read_tree(options.tree);
  const VesselEnd entry = find_entry(tree, entry_choice, models[0]);
  if (models.size() == 1) {
    Catheter catheter(tree, models[0], entry);
    run(catheter, models, entry, tree, script, options, session);
  } else {
    CoaxialCatheters devices(tree, models, entry);
    run(devices, models, entry, tree, script, options, session);
  }
}

}  // namespace

void add_simulate(CLI::App& app, Session& session) {
  const auto options = std::make_shared<SimulateArguments>();
  CLI::App* command = add_command(
      app, session, "simulate", "Steer a catheter through a vessel tree with a script, without a display",
      "  xraycast simulate vessels/tree.vtp --device-model cobra-5f --script push.csv -o log.csv\n"
      "  xraycast simulate vessels/tree.vtp --device-model guidewire-035-j --script push.csv -o log.csv \\\n"
      "    --entry 19 --plot forces.png\n"
      "  xraycast simulate vessels --device-model cobra-5f --script push.csv -o log.csv --map map.exr \\\n"
      "    --cine run.gif --inject 8,9 --size 480x640\n"
      "  xraycast simulate vessels --device-model cobra-5f --script push.csv -o log.csv --map map.exr \\\n"
      "    --cine run.dcm --inject 8,9 --cone 780,1200 --patient Phantom,1\n"
      "  xraycast simulate vessels --device-model cobra-5f --device-model guidewire-035-j --script both.csv "
      "\\\n"
      "    -o log.csv\n"
      "A script is a CSV file: time_s,insertion_mm,rotation_deg in its first line, then numbers; with a "
      "second\n"
      "device also insertion_2_mm,rotation_2_deg. All insertions are counted from the introducer.",
      [options, &session] { simulate(*options, session); });
  command->add_option("TREE", options->tree, "The vessel tree (.vtp or .json), or a folder with a tree.vtp")
      ->required()
      ->type_name("TREE");
  add_coaxial_options(*command, options->instrument_models, options->entry);
  command->add_option("--script", options->script, "Motion of the hub, interpolated linearly between rows")
      ->required()
      ->type_name("CSV");
  command
      ->add_option("-o,--output", options->log,
                   "The log: one row per row of the script, with the hub's force in N and torque in N m")
      ->required()
      ->type_name("CSV");
  command->add_option("--plot", options->plot, "Plot the hub's force and torque over time")->type_name("PNG");
  command->add_option("--map", options->map, "The body map in which --cine is drawn")->type_name("MAP.exr");
  command
      ->add_option("--cine", options->cine,
                   "Frames of the run, ten per second: a folder of PNGs, a .gif, or a .dcm (DICOM XA)")
      ->type_name("DIR|GIF|DCM");
  command
      ->add_option("--look", options->look,
                   "--cine: the catheter attenuates X-rays (fluoro) or is shaded (surface)")
      ->check(CLI::IsMember({"fluoro", "surface"}))
      ->capture_default_str()
      ->type_name("NAME");
  command
      ->add_option("--inject", options->inject,
                   "--cine: inject contrast agent at the tip at 5 ml/s between these times")
      ->type_name("FROM_S,TO_S");
  add_view_options(*command, options->view);
  add_dicom_options(*command, options->dicom);
}

}  // namespace xraycast::cli
