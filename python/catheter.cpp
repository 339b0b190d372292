#include "calls/arguments.hpp"
#include "calls/job.hpp"
#include "calls/monitoring.hpp"
#include "calls/values.hpp"
#include "run.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/motion/body_clock.hpp"
#include "xraycast/scene/catheter_surface.hpp"

#include <fmt/ranges.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <mutex>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <numbers>
#include <optional>
#include <thread>

namespace xraycast::python {
namespace {

constexpr double kRadiansPerDegree = std::numbers::pi / 180;

/// What a step leaves.
struct State {
  RunRecord record;
  bool is_held;
  std::string vessel;  ///< the name of the branch in which the tip is
};

/// How far each instrument's hub moves.
struct HubMoves {
  std::vector<double> push_mm, turn_rad, inflate_bar, release_mm;
  std::vector<double> detach{};  ///< so many coils, as they are there; none: no coils
};

/// Coaxial instruments, or one alone, moved by one thread at a time.
class HeldInstruments {
 public:
  HeldInstruments(const RunRequest& request, const std::optional<Exercise>& exercise)
      : count_(request.instruments.size()),
        request_(request),
        instruments_(*request.tree, request.instruments, entry_of(request), instrument_options(request)),
        monitor_(instruments_, names_of(request.instruments), progress_of(exercise, *request.tree)) {
    for (std::size_t d = 0; d < count_; ++d)
      shown_.push_back({request.instruments[d].name(), instruments_.max_insertion_mm(d)});
  }

  /// Without the interpreter's lock, which it takes now and then to look for Ctrl-C.
  std::vector<State> step(const HubMoves& moves, int steps, const RunningCall& call) {
    const auto lock = locked();
    const Stepping stepping(stepping_);
    check(moves);
    std::vector<HubPose> starts, poses(count());
    for (std::size_t d = 0; d < count(); ++d) starts.push_back(instruments_.pose(d));
    auto looked = std::chrono::steady_clock::now();
    for (int i = 1; i <= steps; ++i) {
      const double share = static_cast<double>(i) / steps;
      for (std::size_t d = 0; d < count(); ++d)
        poses[d] = {starts[d].insertion_mm + share * moves.push_mm[d],
                    starts[d].rotation_rad + share * moves.turn_rad[d],
                    starts[d].inflation_bar + share * moves.inflate_bar[d],
                    starts[d].release_mm + share * moves.release_mm[d],
                    starts[d].detach + (moves.detach.empty() ? 0 : moves.detach[d])};
      instruments_.step(poses, next_phases());
      monitor_.add(instruments_);
      constexpr std::chrono::milliseconds kLookInterval{50};
      if (std::chrono::steady_clock::now() - looked < kLookInterval) continue;
      const nb::gil_scoped_acquire held;
      check_signals();
      call.check();
      looked = std::chrono::steady_clock::now();
    }
    return states_now();
  }

  /// Holds a mode of the body's motion where it is, or lets it go on from there. Throws InputError for a body
  /// without such a mode.
  void hold(const std::string& mode, bool is_held) {
    const auto lock = locked();
    if (!request_.body.motion) throw InputError("mode {}: the body is still; give a motion", excerpt(mode));
    BodyClock clock = clock_ ? *clock_ : clock_now();
    is_held ? clock.hold(mode) : clock.release(mode);
    clock_ = std::move(clock);
  }

  std::vector<State> states() {
    const auto lock = locked();
    return states_now();
  }

  std::shared_ptr<std::vector<glm::dvec3>> nodes_mm(std::size_t instrument) {
    const auto lock = locked();
    auto nodes = std::make_shared<std::vector<glm::dvec3>>();
    instruments_.copy_nodes(instrument, *nodes);
    return nodes;
  }

  std::vector<InstrumentShape> shapes() {
    const auto lock = locked();
    std::vector<InstrumentShape> all(count());
    for (std::size_t d = 0; d < count(); ++d) {
      all[d] = drawn(instruments_.rod(d).instrument());
      instruments_.copy_nodes(d, all[d].nodes_mm);
    }
    return all;
  }

  void exchange(std::size_t instrument, const InstrumentModel& model) {
    const auto lock = locked();
    if (const ExerciseProgress* progress = monitor_.progress()) {
      std::vector<InstrumentModel> models;
      for (std::size_t d = 0; d < count(); ++d)
        models.push_back(d == instrument ? model : instruments_.rod(d).instrument());
      check_allowed(progress->exercise(), models);
    }
    instruments_.exchange(instrument, model);
    monitor_.exchanged(instrument, instruments_, model.name());
    const std::lock_guard shown(shown_mutex_);
    shown_[instrument] = {model.name(), instruments_.max_insertion_mm(instrument)};
  }

  std::string report(bool has_series) {
    const auto lock = locked();
    return monitor_.json(has_series);
  }

  bool has_free_lumen(std::size_t instrument) {
    const auto lock = locked();
    return instruments_.has_free_lumen(instrument);
  }

  // Also with the interpreter's lock and while another thread steps.
  std::string name(std::size_t instrument) {
    const std::lock_guard shown(shown_mutex_);
    return shown_[instrument].name;
  }
  double max_insertion_mm(std::size_t instrument) {
    const std::lock_guard shown(shown_mutex_);
    return shown_[instrument].max_insertion_mm;
  }

  std::size_t count() const { return count_; }

 private:
  /// Throws InputError for what an instrument has not.
  void check(const HubMoves& moves) const {
    for (std::size_t d = 0; d < count(); ++d) {
      const InstrumentModel& model = instruments_.rod(d).instrument();
      if (moves.inflate_bar[d] > 0 && !model.balloon())
        throw InputError("inflate_bar: {} has no balloon; give it 0, or take balloon-6x20, say",
                         model.name());
      if (moves.release_mm[d] > 0 && !model.has_sheath())
        throw InputError("release_mm: {} has no stent in a sheath; give it 0, or take stent-self-8x40, say",
                         model.name());
      if (!moves.detach.empty() && moves.detach[d] > 0 && !model.has_coils())
        throw InputError("detach: {} has no coils; give it 0, or take coil-10x30, say", model.name());
    }
  }

  using Stepper = std::atomic<std::thread::id>;

  /// Says for its lifetime that this thread steps.
  class Stepping {
   public:
    explicit Stepping(Stepper& stepper) : stepper_(stepper) { stepper_ = std::this_thread::get_id(); }
    ~Stepping() { stepper_ = std::thread::id(); }
    Stepping(const Stepping&) = delete;
    Stepping& operator=(const Stepping&) = delete;

   private:
    Stepper& stepper_;
  };

  /// Waits for other threads. Throws Error on a thread that steps, which would wait for itself.
  std::unique_lock<std::mutex> locked() {
    if (stepping_ == std::this_thread::get_id())
      throw Error(
          "a step of this catheter is under way on this thread, which a signal handler interrupted; use the "
          "catheter when step() has returned");
    return std::unique_lock(mutex_);
  }

  /// Of the body's modes, after the next step.
  std::vector<double> next_phases() {
    if (!clock_) return phases_at(request_.body, instruments_.time_s() + instruments_.step_s());
    clock_->advance(instruments_.step_s());
    return clock_->phases();
  }

  BodyClock clock_now() const { return clock_of(request_.body, instruments_.time_s()); }

  std::vector<State> states_now() const {
    std::vector<State> states;
    for (const RunRecord& record : records_of(instruments_, instruments_.time_s()))
      states.push_back({record, instruments_.is_held(states.size()),
                        request_.tree->branches()[static_cast<std::size_t>(record.tip.branch)].name});
    return states;
  }

  struct Shown {
    std::string name;
    double max_insertion_mm = 0;
  };

  std::size_t count_;
  RunRequest request_;
  std::mutex shown_mutex_;
  std::vector<Shown> shown_;
  std::mutex mutex_;                ///< of the instruments
  Stepper stepping_{};              ///< the thread that steps
  std::optional<BodyClock> clock_;  ///< of the body, once a mode was held
  Instruments instruments_;
  RunMonitor monitor_;
};

/// One alone.
struct HeldCatheter {
  HeldInstruments held;
};

void make_catheter(HeldCatheter* catheter, const HeldTree& tree, const PathArgument& model,
                   const EntryArgument& entry, const PathArgument& motion, const PhaseArgument& phase,
                   const PathArgument& exercise) {
  nb::list models;
  models.append(model);
  RunRequest request = run_of(tree, models, entry, motion, phase, "model");
  const std::optional<Exercise> task = take_exercise(request, entry, exercise);
  const nb::gil_scoped_release released;
  new (catheter) HeldCatheter{HeldInstruments(request, task)};
}

void make_instruments(HeldInstruments* instruments, const HeldTree& tree, const ModelsArgument& models,
                      const EntryArgument& entry, const PathArgument& motion, const PhaseArgument& phase,
                      const PathArgument& exercise) {
  RunRequest request = run_of(tree, models, entry, motion, phase, "models");
  const std::optional<Exercise> task = take_exercise(request, entry, exercise);
  const nb::gil_scoped_release released;
  new (instruments) HeldInstruments(request, task);
}

/// One number an instrument; none: 0 for all.
std::vector<double> moves_of(const nb::object& given, std::size_t count, const char* name) {
  if (given.is_none()) return std::vector<double>(count, 0);
  Numbers numbers = numbers_of(given, name);
  if (numbers.shape != std::vector{count})
    throw InputError("{}: must be {}, one an instrument, the outermost first", name,
                     pluralize(count, "number"));
  return std::move(numbers.values);
}

std::vector<State> move_by(HeldInstruments& instruments, HubMoves moves, int ms) {
  constexpr int kLongest_ms = 3'600'000;
  if (ms < 1 || ms > kLongest_ms)
    throw InputError("ms {}: must be 1 to {}, whole steps of 1 ms", ms, kLongest_ms);
  for (const double mm : moves.release_mm)
    if (mm < 0)
      throw InputError("release_mm {}: a sheath does not go back over its stent; give 0 or more", mm);
  for (const double count : moves.detach)
    if (count != 0 && count != 1)
      throw InputError(
          "detach {:g}: a wire has one coil at a time; give 1 for an instrument whose coil is to be "
          "detached, and 0 for the others",
          count);
  for (double& angle : moves.turn_rad) angle *= kRadiansPerDegree;
  Progress progress;
  const RunningCall call(progress);
  const nb::gil_scoped_release released;
  return instruments.step(moves, ms, call);
}

std::vector<State> move_hubs(HeldInstruments& instruments, const ArrayArgument& push_mm,
                             const ArrayArgument& turn_deg, int ms, const ArrayArgument& inflate_bar,
                             const ArrayArgument& release_mm, const ArrayArgument& detach) {
  return move_by(
      instruments,
      {moves_of(push_mm, instruments.count(), "push_mm"), moves_of(turn_deg, instruments.count(), "turn_deg"),
       moves_of(inflate_bar, instruments.count(), "inflate_bar"),
       moves_of(release_mm, instruments.count(), "release_mm"),
       moves_of(detach, instruments.count(), "detach")},
      ms);
}

State move_hub(HeldCatheter& catheter, double push_mm, double turn_deg, int ms, double inflate_bar,
               double release_mm) {
  if (!std::isfinite(push_mm)) throw InputError("push_mm: must be finite");
  if (!std::isfinite(turn_deg)) throw InputError("turn_deg: must be finite");
  if (!std::isfinite(inflate_bar)) throw InputError("inflate_bar: must be finite");
  if (!std::isfinite(release_mm)) throw InputError("release_mm: must be finite");
  return move_by(catheter.held, {{push_mm}, {turn_deg}, {inflate_bar}, {release_mm}}, ms).front();
}

/// Throws InputError for an instrument that there is not.
std::size_t checked_instrument(const HeldInstruments& instruments, int instrument) {
  if (instrument < 0 || static_cast<std::size_t>(instrument) >= instruments.count())
    throw InputError("instrument {}: must be 0 to {}, from the outermost on", instrument,
                     instruments.count() - 1);
  return static_cast<std::size_t>(instrument);
}

auto nodes_of(HeldInstruments& instruments, int instrument) {
  const std::size_t number = checked_instrument(instruments, instrument);
  std::shared_ptr<std::vector<glm::dvec3>> nodes;
  {
    const nb::gil_scoped_release released;
    nodes = instruments.nodes_mm(number);
  }
  return array_over<double, 2>(&nodes->front().x, {nodes->size(), 3}, nodes);
}

template <typename Value>
std::optional<Value> of_coil(const State& state, Value RunRecord::Coil::*what) {
  if (!state.record.coil) return std::nullopt;
  return (*state.record.coil).*what;
}

std::string state_description(const State& s) {
  const glm::dvec3& tip = s.record.tip.position_mm;
  return fmt::format(
      "<xraycast.CatheterState at {:.3f} s: {:.1f} mm in, tip at ({:.1f}, {:.1f}, {:.1f}) mm in branch "
      "{}, {:.2f} N>",
      s.record.time_s, s.record.pose.insertion_mm, tip.x, tip.y, tip.z, s.record.tip.branch,
      s.record.load.force_N);
}

void add_state(nb::module_& module) {
  nb::class_<State>(module, "CatheterState", "A catheter's state after a step.")
      .def_prop_ro("time_s", [](const State& s) { return s.record.time_s; })
      .def_prop_ro(
          "insertion_mm", [](const State& s) { return s.record.pose.insertion_mm; },
          "Length inserted; less than was pushed if the hub is held or cannot move as fast.")
      .def_prop_ro("rotation_deg",
                   [](const State& s) { return s.record.pose.rotation_rad / kRadiansPerDegree; })
      .def_prop_ro(
          "force_N", [](const State& s) { return s.record.load.force_N; },
          "The force on the hand at the hub; a positive one pushes it back.")
      .def_prop_ro("torque_Nm", [](const State& s) { return s.record.load.torque_Nm; })
      .def_prop_ro(
          "tip_mm", [](const State& s) { return tuple_of(s.record.tip.position_mm); }, "(x, y, z), mm, LPS.")
      .def_prop_ro(
          "tip_direction", [](const State& s) { return tuple_of(s.record.tip.direction); },
          "The unit vector along the instrument at its tip.")
      .def_prop_ro(
          "branch", [](const State& s) { return s.record.tip.branch; },
          "The number of the tree's branch in which the tip is.")
      .def_prop_ro(
          "vessel", [](const State& s) { return text_object(s.vessel); },
          "The name of that branch; empty for one without.")
      .def_prop_ro(
          "arc_length_mm", [](const State& s) { return s.record.tip.arc_length_mm; },
          "The tip's distance from the branch's first point, along the branch.")
      .def_prop_ro(
          "contacts", [](const State& s) { return s.record.contacts; },
          "The number of points that touch a wall.")
      .def_prop_ro(
          "contact_force_N", [](const State& s) { return s.record.contact_force_N; },
          "The sum of the walls' forces.")
      .def_prop_ro(
          "tip_scan_mm", [](const State& s) { return tuple_of(s.record.tip.scan_mm); },
          "What the tip's place shows: tip_mm, but in a body that moves the scan's, where the tree lies.")
      .def_prop_ro(
          "wall_work_J", [](const State& s) { return s.record.wall_work_J; },
          "What moving walls, walls that yield and its balloon have done on the instrument so far.")
      .def_prop_ro(
          "balloon_bar", [](const State& s) { return s.record.balloon_bar; },
          "The pressure in its balloon, as far as it is filled.")
      .def_prop_ro(
          "balloon_mm", [](const State& s) { return s.record.balloon_mm; },
          "The diameter of its balloon; 0 without one.")
      .def_prop_ro(
          "release_mm", [](const State& s) { return s.record.pose.release_mm; },
          "How far the sheath of its stent is drawn back.")
      .def_prop_ro(
          "free_rings", [](const State& s) { return s.record.free_rings; },
          "The rings of the stent in its sheath that are free; None without a sheath.")
      .def_prop_ro(
          "coil_mm", [](const State& s) { return of_coil(s, &RunRecord::Coil::out_mm); },
          "How much of the coil on its wire lies in an aneurysm; None without coils.")
      .def_prop_ro(
          "coils_detached", [](const State& s) { return of_coil(s, &RunRecord::Coil::detached); },
          "The coils that it left so far; None without coils.")
      .def_prop_ro(
          "packing", [](const State& s) { return of_coil(s, &RunRecord::Coil::packing); },
          "The packing density of the aneurysm that it has coils in, 0 to 1; None without coils.")
      .def_prop_ro(
          "phases", [](const State& s) { return s.record.phases; },
          "The phases of the motion's modes, in order; none in a still body.")
      .def_prop_ro(
          "is_held", [](const State& s) { return s.is_held; },
          "The hub did not advance, since the push force is 3 N already.")
      .def("__repr__", state_description);
}

std::vector<std::string> names_of(HeldInstruments& instruments) {
  std::vector<std::string> names;
  for (std::size_t d = 0; d < instruments.count(); ++d) names.push_back(instruments.name(d));
  return names;
}

void exchange_instrument(HeldInstruments& instruments, int instrument, const PathArgument& model) {
  const std::size_t number = checked_instrument(instruments, instrument);
  const std::string name = instrument_name(model, "model");
  const nb::gil_scoped_release released;
  instruments.exchange(number, InstrumentModel::named(name));
}

constexpr const char* kHoldHelp =
    "Holds a mode of the body's motion where it is, such as the breath, or with is_held=False lets it go on "
    "from "
    "there.";

constexpr const char* kReportHelp =
    "What it did so far, in figures (docs/exercises.md), as a dict. series: with values over time.";

nb::dict instruments_report(HeldInstruments& instruments, bool has_series) {
  std::string json;
  {
    const nb::gil_scoped_release released;
    json = instruments.report(has_series);
  }
  return report_object(json);
}

void hold_mode(HeldInstruments& instruments, const std::string& mode, bool is_held) {
  const nb::gil_scoped_release released;
  instruments.hold(mode, is_held);
}

void add_instruments(nb::module_& module) {
  nb::class_<HeldInstruments>(
      module, "CoaxialInstruments",
      "Up to three instruments one in the other, such as a guide wire in a catheter, each moved at "
      "its own hub. Lists have one item for each instrument, the outermost first.")
      .def("__init__", make_instruments, nb::arg("tree"), nb::arg("models").none(), nb::kw_only(),
           nb::arg("entry") = nb::none(), nb::arg("motion") = nb::none(), nb::arg("phase") = nb::none(),
           nb::arg("exercise") = nb::none(),
           "models: as Catheter's, a list, the outermost first; each fits into those before it.  entry, "
           "motion, phase, exercise: as Catheter's.")
      .def("step", move_hubs, nb::arg("push_mm") = nb::none(), nb::arg("turn_deg") = nb::none(),
           nb::arg("ms") = 1, nb::kw_only(), nb::arg("inflate_bar") = nb::none(),
           nb::arg("release_mm") = nb::none(), nb::arg("detach") = nb::none(),
           "Moves each hub by its numbers in push_mm and turn_deg, changes the pressure of its balloon by "
           "that "
           "in inflate_bar, and draws the sheath of its stent back by that in release_mm, evenly over `ms` "
           "steps "
           "of 1 ms, detaches its coil where detach has a 1, at once, and returns a "
           "CatheterState "
           "for each instrument.")
      .def("hold", hold_mode, nb::arg("mode"), nb::arg("is_held") = true, kHoldHelp)
      .def("report", instruments_report, nb::arg("series") = false, kReportHelp)
      .def_prop_ro("states", &HeldInstruments::states, nb::call_guard<nb::gil_scoped_release>())
      .def("nodes_mm", nodes_of, nb::arg("instrument"), kShared,
           "An instrument from the introducer to its tip, (nodes, 3) float64, mm, LPS; a new array.")
      .def(
          "exchange", exchange_instrument, nb::arg("instrument"), nb::arg("model").none(),
          "Replaces an instrument that is drawn back to an insertion of at most 1 mm by another model, in an "
          "exercise by one that it allows. The others stay.")
      .def(
          "has_free_lumen",
          [](HeldInstruments& d, int instrument) {
            return d.has_free_lumen(checked_instrument(d, instrument));
          },
          nb::arg("instrument"), nb::call_guard<nb::gil_scoped_release>(),
          "Whether it has a lumen with no other instrument inserted, so that contrast agent can be injected.")
      .def_prop_ro("shapes", &HeldInstruments::shapes, nb::call_guard<nb::gil_scoped_release>(),
                   "An InstrumentShape for each instrument now, for frames.")
      .def_prop_ro("models", names_of)
      .def_prop_ro("max_insertion_mm",
                   [](HeldInstruments& d) {
                     std::vector<double> most_mm;
                     for (std::size_t i = 0; i < d.count(); ++i) most_mm.push_back(d.max_insertion_mm(i));
                     return most_mm;
                   })
      .def("__len__", &HeldInstruments::count)
      .def("__repr__", [](HeldInstruments& d) {
        return text_object(fmt::format("<xraycast.CoaxialInstruments {}>", fmt::join(names_of(d), ", ")));
      });
}

}  // namespace

std::optional<std::vector<InstrumentShape>> steered_shapes(nb::handle instruments) {
  HeldInstruments* held = nullptr;
  if (nb::isinstance<HeldInstruments>(instruments)) held = nb::cast<HeldInstruments*>(instruments);
  if (nb::isinstance<HeldCatheter>(instruments)) held = &nb::cast<HeldCatheter*>(instruments)->held;
  if (!held) return std::nullopt;
  const nb::gil_scoped_release released;
  return held->shapes();
}

void add_catheter(nb::module_& module) {
  add_state(module);
  add_instruments(module);
  nb::class_<HeldCatheter>(module, "Catheter", "A catheter or guide wire in a vessel tree, moved at its hub.")
      .def("__init__", make_catheter, nb::arg("tree"), nb::arg("model"), nb::kw_only(),
           nb::arg("entry") = nb::none(), nb::arg("motion") = nb::none(), nb::arg("phase") = nb::none(),
           nb::arg("exercise") = nb::none(),
           "model: an instrument's name, such as cobra-5f or guidewire-035-j (the error for a wrong one "
           "lists all), or a JSON file.\n"
           "entry: a branch's number or its vessel's name, or a point (x, y, z) in mm near a vessel's end; "
           "default: the most "
           "inferior end that it fits into.\n"
           "motion: a motion.json, by which the body moves about the instrument while it steps.  phase: a "
           "dict "
           "of modes that are held, and their phases, 0 to 1; the others go on.\n"
           "exercise: a file of a task (docs/exercises.md), which report() tells of, and whose entry is the "
           "default.")
      .def("step", move_hub, nb::arg("push_mm") = 0.0, nb::arg("turn_deg") = 0.0, nb::arg("ms") = 1,
           nb::kw_only(), nb::arg("inflate_bar") = 0.0, nb::arg("release_mm") = 0.0,
           "Moves the hub by push_mm and turn_deg, changes the pressure of its balloon by inflate_bar, and "
           "draws "
           "the sheath of its stent back by release_mm, evenly over `ms` steps of 1 ms, and returns the "
           "CatheterState.")
      .def(
          "hold",
          [](HeldCatheter& c, const std::string& mode, bool is_held) { hold_mode(c.held, mode, is_held); },
          nb::arg("mode"), nb::arg("is_held") = true, kHoldHelp)
      .def(
          "report", [](HeldCatheter& c, bool series) { return instruments_report(c.held, series); },
          nb::arg("series") = false, kReportHelp)
      .def_prop_ro(
          "state", [](HeldCatheter& c) { return c.held.states().front(); },
          nb::call_guard<nb::gil_scoped_release>())
      .def_prop_ro(
          "nodes_mm", [](HeldCatheter& c) { return nodes_of(c.held, 0); }, kShared,
          "The rod from the introducer to the tip, (nodes, 3) float64, mm, LPS; a new array.")
      .def_prop_ro(
          "shape", [](HeldCatheter& c) { return c.held.shapes().front(); },
          nb::call_guard<nb::gil_scoped_release>(), "Its InstrumentShape now, for frames.")
      .def_prop_ro("model", [](HeldCatheter& c) { return text_object(c.held.name(0)); })
      .def_prop_ro("max_insertion_mm", [](HeldCatheter& c) { return c.held.max_insertion_mm(0); })
      .def("__repr__", [](HeldCatheter& c) {
        return text_object(fmt::format("<xraycast.Catheter {}>", c.held.name(0)));
      });
}

}  // namespace xraycast::python
