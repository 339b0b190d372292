#include "run.hpp"

#include "calls/arguments.hpp"
#include "calls/blood.hpp"
#include "calls/entry.hpp"
#include "calls/job.hpp"
#include "calls/monitoring.hpp"
#include "calls/run_records.hpp"
#include "calls/values.hpp"
#include "scans/motion.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/reports/hub_plot.hpp"
#include "xraycast/reports/pressure_plot.hpp"
#include "xraycast/reports/run_comparison.hpp"

#include <fmt/ranges.h>

#include <array>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <tuple>

namespace xraycast::python {
namespace {

/// Of a file, or of an array (rows, 1 + 2 instruments), of balloons (rows, 1 + 3 instruments), of stents in
/// sheaths (rows, 1 + 4 instruments), of coils (rows, 1 + 5 instruments).
Script script_of(const nb::object& script, std::size_t instruments) {
  if (is_path(script)) return Script::read(path_of(script), instruments);
  const Numbers numbers = numbers_of(script, "script");
  const std::size_t columns = 1 + 2 * instruments, with_balloons = columns + instruments,
                    with_sheaths = with_balloons + instruments, with_coils = with_sheaths + instruments;
  const std::size_t given = numbers.shape.size() == 2 ? numbers.shape[1] : 0;
  if (given != columns && given != with_balloons && given != with_sheaths && given != with_coils)
    throw InputError(
        "script: must be a file or (rows, {}): time_s, then insertion_mm and rotation_deg of each "
        "instrument; "
        "or (rows, {}), with inflation_bar too; or (rows, {}), with release_mm as well; or (rows, {}), "
        "with detach as well",
        columns, with_balloons, with_sheaths, with_coils);
  const std::size_t of_each = (given - 1) / instruments;
  std::vector<Script::Row> rows(numbers.shape[0]);
  const double* value = numbers.values.data();
  for (Script::Row& row : rows) {
    row.time_s = *value++;
    row.inner_poses.resize(instruments - 1);
    for (std::size_t d = 0; d < instruments; ++d, value += of_each)
      (d == 0 ? row.pose : row.inner_poses[d - 1]) = {
          value[0], value[1] / kDegreesPerRadian, of_each >= 3 ? value[2] : 0, of_each >= 4 ? value[3] : 0,
          of_each >= 5 ? value[4] : 0};
  }
  return Script::of(std::move(rows), "script", instruments);
}

/// Between two times; none where they are None.
Injection injection_of(const nb::object& times, double rate_ml_s, double iodine_mg_ml, double particles_mm) {
  Injection injection{.rate_ml_s = rate_ml_s, .agent_mg_ml = iodine_mg_ml, .particles = {particles_mm}};
  if (times.is_none()) {
    const Injection usual;
    for (const auto& [name, given, unused] : {std::tuple("particles_mm", particles_mm, 0.0),
                                              std::tuple("injection_rate_ml_s", rate_ml_s, usual.rate_ml_s),
                                              std::tuple("iodine_mg_ml", iodine_mg_ml, usual.agent_mg_ml)})
      if (given != unused) throw InputError("{} {:g}: needs `inject` too", name, given);
    return injection;
  }
  const Numbers numbers = numbers_of(times, "inject");
  if (numbers.shape.size() != 1 || numbers.shape[0] != 2)
    throw InputError("inject: must be the times (from, to), in s");
  injection.from_s = numbers.values[0];
  injection.to_s = numbers.values[1];
  check(injection);
  return injection;
}

HeldRun simulate(const HeldTree& tree, const nb::object& instruments, const nb::object& script,
                 const nb::object& entry, double interval_s, const PathArgument& motion,
                 const PhaseArgument& phase, const PathArgument& exercise, const nb::object& heart_rate_bpm,
                 const nb::object& heart_waveform, const nb::object& inject, double injection_rate_ml_s,
                 double iodine_mg_ml, double particles_mm, const nb::object& progress) {
  HeldRun held{run_of(tree, instruments, entry, motion, phase, "instruments"), {}};
  held.request.script = script_of(script, held.request.instruments.size());
  held.request.interval_s = interval_s;
  held.request.blood = blood_of(heart_rate_bpm, heart_waveform);
  held.request.injection = injection_of(inject, injection_rate_ml_s, iodine_mg_ml, particles_mm);
  const std::optional<Exercise> task = take_exercise(held.request, entry, exercise);
  return result_of(progress, [&](Progress& reported) {
    std::vector<std::string> notes = check(held.request);
    if (held.request.script->rows().back().time_s <= RecordedRun::kLongest_s)
      held.recorded = RecordedRun::of(held.request.instruments);
    std::optional<RunMonitor> monitor;
    RunUse use;
    held.run =
        run(held.request, reported,
            [&](const Instruments& moved, double time_s, const InstrumentPressures& blood) {
              use = with_blood({}, held.request, blood);
              if (monitor)
                monitor->add(moved, use);
              else
                monitor.emplace(moved, names_of(held.request.instruments), progress_of(task, *tree.tree));
              if (held.recorded) held.recorded->record(moved, time_s);
            });
    use.embolised = held.run.embolised;
    monitor->use(use);
    held.report = monitor->json(true);
    notes.insert(notes.end(), held.run.notes.begin(), held.run.notes.end());
    held.run.notes = std::move(notes);
    return std::move(held);
  });
}

auto phases_array(const HeldRun& held) {
  const auto all = std::make_shared<std::vector<double>>();
  for (const std::vector<RunRecord>& of_instruments : held.run.records)
    all->insert(all->end(), of_instruments[0].phases.begin(), of_instruments[0].phases.end());
  return array_over<double, 2>(all->data(), {held.run.records.size(), held.run.modes.size()}, all);
}

auto pressures_array(const HeldRun& held) {
  const auto all = std::make_shared<std::vector<double>>();
  for (const PressureSample& sample : held.run.pressures) {
    all->insert(all->end(), {sample.time_s, sample.aortic_mmHg});
    all->insert(all->end(), sample.tips_mmHg.begin(), sample.tips_mmHg.end());
  }
  return array_over<double, 2>(all->data(), {held.run.pressures.size(), 2 + held.request.instruments.size()},
                               all);
}

auto pressure_plot_of(const HeldRun& held) {
  return picture_array(pressure_plot(held.run, names_of(held.request.instruments)));
}

auto plot_of(const HeldRun& held, int instrument) {
  const auto& instruments = held.request.instruments;
  if (instrument < 0 || instrument >= std::ssize(instruments))
    throw InputError("instrument {}: must be 0 to {}", instrument, instruments.size() - 1);
  const auto number = static_cast<std::size_t>(instrument);
  return picture_array(
      hub_plot(fmt::format("{}: at the hub", instruments[number].name()), held.run.records, number));
}

nb::dict run_report(const HeldRun& held, const PathArgument& path) {
  if (!path.is_none()) write_runs(path_of(path), {SavedRun::parse(held.report, "run")});
  return report_object(held.report);
}

}  // namespace

std::string instrument_name(nb::handle object, const std::string& argument) {
  try {
    return path_of(object);
  } catch (const nb::python_error& error) {
    if (!error.matches(PyExc_TypeError)) throw;
    throw InputError("{}: must be the name of an instrument or of its JSON file", argument);
  }
}

RunRequest run_of(const HeldTree& tree, const nb::object& instruments, const nb::object& entry,
                  const nb::object& motion, const nb::object& phase, const std::string& name) {
  if (nb::isinstance<nb::str>(instruments) || !nb::isinstance<nb::sequence>(instruments))
    throw InputError("{}: must be a list of instruments, the outermost first", name);
  std::vector<std::string> names;
  for (const nb::handle instrument : instruments)
    names.push_back(instrument_name(instrument, fmt::format("{}[{}]", name, names.size())));
  RunRequest request{.tree = tree.tree,
                     .instruments = instruments_named(names),
                     .entry = entry_choice(entry),
                     .body = body_request_of(motion, phase)};
  check(request);
  return request;
}

void add_run(nb::module_& module) {
  nb::class_<HeldRun>(module, "Run", "What simulate() gives: the records of instruments that a script moved.")
      .def_prop_ro(
          "records", [](const HeldRun& r) { return nb::borrow<RecordArray>(records_array(r.run.records)); },
          "A structured array (records, instruments), the outermost instrument first, with the fields "
          "time_s, insertion_mm, rotation_deg, force_N and torque_Nm of the hub, tip_mm (x, y, z), "
          "tip_direction, branch, arc_length_mm, contacts, contact_force_N, deepest_mm, in a wall, "
          "tip_scan_mm and wall_work_J (see CatheterState), and pressure_mmHg and aortic_mmHg of the blood "
          "at the tip "
          "and in the aorta.")
      .def_prop_ro("pressures", pressures_array, kShared,
                   "The blood's pressure over the run, (samples, 2 + instruments) float64, a hundred a "
                   "second, fewer in "
                   "runs longer than 300 s: time in s, mmHg in the aorta, and at the tip of each instrument.")
      .def("pressure_plot", pressure_plot_of, kShared, "These pressures over time: (rows, columns, 3) uint8.")
      .def_prop_ro(
          "modes", [](const HeldRun& r) { return text_objects(r.run.modes); },
          "The names of the motion's modes; none of a still body.")
      .def_prop_ro("phases", phases_array, kShared,
                   "The phases of the modes at each record, (records, modes) float64.")
      .def_prop_ro(
          "last",
          [](const HeldRun& r) { return nb::borrow<RecordArray>(records_array({r.run.last})[nb::int_(0)]); },
          "The instruments' states at the end, (instruments,), as a record of each; time_s since they began "
          "to move.")
      .def_prop_ro("instruments", [](const HeldRun& r) { return names_of(r.request.instruments); })
      .def_prop_ro(
          "entry_branch", [](const HeldRun& r) { return r.run.entry.branch; },
          "The number of the branch at whose end the instruments entered.")
      .def_prop_ro(
          "entry_mm",
          [](const HeldRun& r) {
            const auto& p = r.run.entry.position_mm;
            return tuple_of({p.x(), p.y(), p.z()});
          },
          "That end (x, y, z), mm, LPS.")
      .def_prop_ro(
          "held_s", [](const HeldRun& r) { return r.run.held_s; },
          "For so long a hub did not advance, since the push force was 3 N already.")
      .def_prop_ro(
          "embolised",
          [](const HeldRun& r) {
            nb::list leaves;
            for (const Embolised& leaf : r.run.embolised)
              leaves.append(nb::make_tuple(leaf.branch, leaf.particles, leaf.open_share));
            return leaves;
          },
          nb::sig("def embolised(self) -> list[tuple[int, float, float]]"),
          "Where injected particles went: the number of a branch, or -1 of the rest of the body, that of the "
          "particles behind its end, and how much of its periphery's conductance is left, 0 to 1.")
      .def_prop_ro(
          "notes", [](const HeldRun& r) { return text_objects(r.run.notes); },
          "What to know of the run, such as other ends at which the instruments might have entered.")
      .def("plot", plot_of, nb::arg("instrument") = 0, kShared,
           "The force and the torque at an instrument's hub over time: (rows, columns, 3) uint8.\n\n"
           "instrument: its number, 0 for the outermost.")
      .def("report", run_report, nb::arg("path") = nb::none(),
           "What the instruments did, in figures (docs/exercises.md), as a dict; with a path also written as "
           "a "
           "page with plots (.html), a table (.csv) or .json.")
      .def(
          "write",
          [](const HeldRun& r, const PathArgument& path) { write_whole_file(path_of(path), to_csv(r.run)); },
          nb::arg("path"), "Writes the records as CSV, as `xraycast simulate` does.")
      .def("__repr__", [](const HeldRun& r) {
        return text_object(fmt::format("<xraycast.Run of {}: {} records>",
                                       fmt::join(names_of(r.request.instruments), ", "),
                                       r.run.records.size()));
      });
  module.def(
      "simulate", simulate, nb::arg("tree"), nb::arg("instruments").none(), nb::arg("script").none(),
      nb::kw_only(), nb::arg("entry") = nb::none(), nb::arg("interval_s") = 0.0,
      nb::arg("motion") = nb::none(), nb::arg("phase") = nb::none(), nb::arg("exercise") = nb::none(),
      nb::arg("heart_rate_bpm") = nb::none(), nb::arg("heart_waveform") = nb::none(),
      nb::arg("inject") = nb::none(), nb::arg("injection_rate_ml_s") = Injection{}.rate_ml_s,
      nb::arg("iodine_mg_ml") = Injection{}.agent_mg_ml, nb::arg("particles_mm") = 0.0,
      nb::arg("progress") = nb::none(),
      nb::sig("def simulate(tree: VesselTree, instruments: collections.abc.Sequence[str | os.PathLike[str]], "
              "script: str | os.PathLike[str] | numpy.typing.ArrayLike, *, "
              "entry: int | numpy.typing.ArrayLike | None = None, interval_s: float = 0.0, "
              "motion: str | os.PathLike[str] | None = None, phase: dict[str, float] | None = None, "
              "exercise: str | os.PathLike[str] | None = None, heart_rate_bpm: float | None = None, "
              "heart_waveform: str | os.PathLike[str] | numpy.typing.ArrayLike | None = None, "
              "inject: numpy.typing.ArrayLike | None = None, injection_rate_ml_s: float = 5.0, "
              "iodine_mg_ml: float = 350.0, particles_mm: float = 0.0, "
              "progress: xraycast._progress.Listener | None = None) -> Run"),
      "Moves instruments through a VesselTree by a script, as fast as the machine can, and returns a Run.\n\n"
      "instruments: names of instruments or their JSON files, the outermost first; up to three, one in the "
      "other.\n"
      "script: a CSV file (see `xraycast simulate`), or an array (rows, 1 + 2 instruments): time in s, then "
      "insertion in mm and rotation in degrees of each hub, interpolated linearly; of instruments with "
      "balloons "
      "(rows, 1 + 3 instruments), with the pressure in bar after each rotation; of stents in sheaths (rows, "
      "1 + 4 "
      "instruments), with how far the sheath is drawn back in mm after that.\n"
      "entry: as Catheter's.  interval_s: between records; 0: one for each row of the script.\n"
      "motion: a motion.json, by which the body moves from 0 s on.  phase: a dict of modes that are held, "
      "and "
      "their phases, 0 to 1.  exercise: a file of a task, which Run.report() tells of, and whose entry is "
      "the default.  heart_rate_bpm: beats per minute (None: 70), which pace the blood; 0: it flows "
      "steadily.  "
      "heart_waveform: as flow()'s.\n"
      "inject: times (from, to) in s, between which contrast agent is injected at the tip, at "
      "`injection_rate_ml_s`, of `iodine_mg_ml`, with particles of `particles_mm` in it, which close the "
      "arterioles where the blood takes them (Run.embolised).");
}

}  // namespace xraycast::python
