#include "xraycast/mechanics/catheter.hpp"

#include "job.hpp"
#include "values.hpp"
#include "vessels.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/simulation/run_script.hpp"

#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <mutex>
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
};

/// A catheter, moved by one thread at a time.
class HeldCatheter {
 public:
  HeldCatheter(std::shared_ptr<const VesselTree> tree, const InstrumentModel& model, const EntryChoice& entry)
      : tree_(std::move(tree)),
        name_(model.name()),
        catheter_(*tree_, model, find_entry(*tree_, entry, model)) {}

  /// Without the interpreter's lock, which it takes now and then to look for Ctrl-C.
  State step(double push_mm, double turn_rad, int steps, const RunningCall& call) {
    const auto lock = locked();
    const Stepping stepping(stepping_);
    const HubPose start = catheter_.pose();
    auto looked = std::chrono::steady_clock::now();
    for (int i = 1; i <= steps; ++i) {
      const double share = static_cast<double>(i) / steps;
      catheter_.step({start.insertion_mm + share * push_mm, start.rotation_rad + share * turn_rad});
      constexpr std::chrono::milliseconds kLookInterval{50};
      if (std::chrono::steady_clock::now() - looked < kLookInterval) continue;
      const nb::gil_scoped_acquire held;
      check_signals();
      call.check();
      looked = std::chrono::steady_clock::now();
    }
    return state_now();
  }

  State state() {
    const auto lock = locked();
    return state_now();
  }

  std::shared_ptr<std::vector<glm::dvec3>> nodes_mm() {
    const auto lock = locked();
    auto nodes = std::make_shared<std::vector<glm::dvec3>>();
    catheter_.copy_nodes(*nodes);
    return nodes;
  }

  const std::string& name() const { return name_; }
  double max_insertion_mm() const { return catheter_.max_insertion_mm(); }

 private:
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

  State state_now() const { return {record_of(catheter_, catheter_.time_s()), catheter_.is_held()}; }

  std::shared_ptr<const VesselTree> tree_;
  std::string name_;
  std::mutex mutex_;
  Stepper stepping_{};  ///< the thread that steps
  Catheter catheter_;
};

/// A branch's number, as operator.index gives it; none for what is no number, such as a point.
std::optional<int> branch_of(const nb::object& entry) {
  const nb::object number = nb::steal(PyNumber_Index(entry.ptr()));
  if (!number.is_valid()) {
    if (!PyErr_ExceptionMatches(PyExc_TypeError)) throw nb::python_error();
    PyErr_Clear();
    return std::nullopt;
  }
  int overflow = 0;
  const long branch = PyLong_AsLongAndOverflow(number.ptr(), &overflow);
  if (overflow != 0 || branch < 0 || branch > std::numeric_limits<int>::max())
    throw InputError("entry {}: must be the number of a branch, 0 or more", nb::str(number).c_str());
  return static_cast<int>(branch);
}

EntryChoice entry_of(const nb::object& entry) {
  if (entry.is_none()) return {};
  if (const auto branch = branch_of(entry)) return {*branch, "entry"};
  return {point_of(entry, "entry"), "entry"};
}

void make_catheter(HeldCatheter* catheter, const HeldTree& tree, const nb::object& model,
                   const nb::object& entry) {
  const std::string name = path_of(model);
  const EntryChoice choice = entry_of(entry);
  const nb::gil_scoped_release released;
  new (catheter) HeldCatheter(tree.tree, InstrumentModel::named(name), choice);
}

State move_hub(HeldCatheter& catheter, double push_mm, double turn_deg, int ms) {
  constexpr int kLongest_ms = 3'600'000;
  if (ms < 1 || ms > kLongest_ms)
    throw InputError("ms {}: must be 1 to {}, whole steps of 1 ms", ms, kLongest_ms);
  if (!std::isfinite(push_mm)) throw InputError("push_mm: must be finite");
  if (!std::isfinite(turn_deg)) throw InputError("turn_deg: must be finite");
  Progress progress;
  const RunningCall call(progress);
  const nb::gil_scoped_release released;
  return catheter.step(push_mm, kRadiansPerDegree * turn_deg, ms, call);
}

auto nodes_of(HeldCatheter& catheter) {
  std::shared_ptr<std::vector<glm::dvec3>> nodes;
  {
    const nb::gil_scoped_release released;
    nodes = catheter.nodes_mm();
  }
  return array_over<double, 2>(&nodes->front().x, {nodes->size(), 3}, nodes);
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
          "Length fed in. Less than was pushed where the hub is held, or cannot move as fast.")
      .def_prop_ro("rotation_deg",
                   [](const State& s) { return s.record.pose.rotation_rad / kRadiansPerDegree; })
      .def_prop_ro(
          "force_N", [](const State& s) { return s.record.load.force_N; },
          "On the hand at the hub; positive pushes it back.")
      .def_prop_ro("torque_Nm", [](const State& s) { return s.record.load.torque_Nm; })
      .def_prop_ro(
          "tip_mm", [](const State& s) { return tuple_of(s.record.tip.position_mm); }, "(x, y, z), mm, LPS.")
      .def_prop_ro(
          "tip_direction", [](const State& s) { return tuple_of(s.record.tip.direction); }, "Of length 1.")
      .def_prop_ro(
          "branch", [](const State& s) { return s.record.tip.branch; }, "Of the tree, where the tip is.")
      .def_prop_ro(
          "arc_length_mm", [](const State& s) { return s.record.tip.arc_length_mm; },
          "Of the tip, from the branch's first point.")
      .def_prop_ro(
          "contacts", [](const State& s) { return s.record.contacts; }, "Points that touch a wall.")
      .def_prop_ro(
          "contact_force_N", [](const State& s) { return s.record.contact_force_N; },
          "The sum of the walls' forces.")
      .def_prop_ro(
          "is_held", [](const State& s) { return s.is_held; },
          "The hub did not advance, since the push force is 3 N already.")
      .def("__repr__", state_description);
}

}  // namespace

void add_catheter(nb::module_& module) {
  add_state(module);
  nb::class_<HeldCatheter>(module, "Catheter", "A catheter or guide wire in a vessel tree, moved at its hub.")
      .def("__init__", make_catheter, nb::arg("tree"), nb::arg("model"), nb::kw_only(),
           nb::arg("entry") = nb::none(),
           "model: cobra-5f, simmons2-5f, pigtail-5f, microcatheter-27f, guidewire-035-j, or a JSON file.\n"
           "entry: the number of a branch, or a point (x, y, z) in mm near a vessel's end; else the most "
           "inferior end "
           "that it fits into.")
      .def("step", move_hub, nb::arg("push_mm") = 0.0, nb::arg("turn_deg") = 0.0, nb::arg("ms") = 1,
           "Moves the hub by so much, evenly over so many steps of 1 ms, and returns the CatheterState.")
      .def_prop_ro("state", &HeldCatheter::state, nb::call_guard<nb::gil_scoped_release>())
      .def_prop_ro("nodes_mm", nodes_of, kShared,
                   "The rod from the introducer to the tip, (nodes, 3) float64, mm, LPS; a new array.")
      .def_prop_ro("model", [](const HeldCatheter& c) { return text_object(c.name()); })
      .def_prop_ro("max_insertion_mm", &HeldCatheter::max_insertion_mm)
      .def("__repr__", [](const HeldCatheter& c) {
        return text_object(fmt::format("<xraycast.Catheter {}>", c.name()));
      });
}

}  // namespace xraycast::python
