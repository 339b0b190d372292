#include "calls/job.hpp"
#include "calls/values.hpp"
#include "run.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"

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
};

/// How far each device's hub moves.
struct Motion {
  std::vector<double> push_mm, turn_rad;
};

/// Coaxial devices, or one alone, moved by one thread at a time.
class HeldDevices {
 public:
  explicit HeldDevices(const RunRequest& request)
      : count_(request.instruments.size()), devices_(*request.tree, request.instruments, entry_of(request)) {
    for (std::size_t d = 0; d < count_; ++d)
      shown_.push_back({request.instruments[d].name(), devices_.max_insertion_mm(d)});
  }

  /// Without the interpreter's lock, which it takes now and then to look for Ctrl-C.
  std::vector<State> step(const Motion& motion, int steps, const RunningCall& call) {
    const auto lock = locked();
    const Stepping stepping(stepping_);
    std::vector<HubPose> starts, poses(count());
    for (std::size_t d = 0; d < count(); ++d) starts.push_back(devices_.pose(d));
    auto looked = std::chrono::steady_clock::now();
    for (int i = 1; i <= steps; ++i) {
      const double share = static_cast<double>(i) / steps;
      for (std::size_t d = 0; d < count(); ++d)
        poses[d] = {starts[d].insertion_mm + share * motion.push_mm[d],
                    starts[d].rotation_rad + share * motion.turn_rad[d]};
      devices_.step(poses);
      constexpr std::chrono::milliseconds kLookInterval{50};
      if (std::chrono::steady_clock::now() - looked < kLookInterval) continue;
      const nb::gil_scoped_acquire held;
      check_signals();
      call.check();
      looked = std::chrono::steady_clock::now();
    }
    return states_now();
  }

  std::vector<State> states() {
    const auto lock = locked();
    return states_now();
  }

  std::shared_ptr<std::vector<glm::dvec3>> nodes_mm(std::size_t device) {
    const auto lock = locked();
    auto nodes = std::make_shared<std::vector<glm::dvec3>>();
    devices_.copy_nodes(device, *nodes);
    return nodes;
  }

  std::vector<DeviceShape> shapes() {
    const auto lock = locked();
    std::vector<DeviceShape> all(count());
    for (std::size_t d = 0; d < count(); ++d) {
      devices_.copy_nodes(d, all[d].nodes_mm);
      const InstrumentModel& model = devices_.rod(d).instrument();
      all[d].radius_mm = model.radius_mm();
      all[d].has_lumen = model.inner_radius_mm() > 0;
    }
    return all;
  }

  void exchange(std::size_t device, const InstrumentModel& model) {
    const auto lock = locked();
    devices_.exchange(device, model);
    const std::lock_guard shown(shown_mutex_);
    shown_[device] = {model.name(), devices_.max_insertion_mm(device)};
  }

  bool has_free_lumen(std::size_t device) {
    const auto lock = locked();
    return devices_.has_free_lumen(device);
  }

  // Also with the interpreter's lock and while another thread steps.
  std::string name(std::size_t device) {
    const std::lock_guard shown(shown_mutex_);
    return shown_[device].name;
  }
  double max_insertion_mm(std::size_t device) {
    const std::lock_guard shown(shown_mutex_);
    return shown_[device].max_insertion_mm;
  }

  std::size_t count() const { return count_; }

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

  std::vector<State> states_now() const {
    std::vector<State> states;
    for (const RunRecord& record : records_of(devices_, devices_.time_s()))
      states.push_back({record, devices_.is_held(states.size())});
    return states;
  }

  struct Shown {
    std::string name;
    double max_insertion_mm = 0;
  };

  std::size_t count_;
  std::mutex shown_mutex_;
  std::vector<Shown> shown_;
  std::mutex mutex_;    ///< of the devices
  Stepper stepping_{};  ///< the thread that steps
  Instruments devices_;
};

/// One alone.
struct HeldCatheter {
  HeldDevices held;
};

void make_catheter(HeldCatheter* catheter, const HeldTree& tree, const nb::object& model,
                   const nb::object& entry) {
  nb::list models;
  models.append(model);
  const RunRequest request = run_of(tree, models, entry, "model");
  const nb::gil_scoped_release released;
  new (catheter) HeldCatheter{HeldDevices(request)};
}

void make_devices(HeldDevices* devices, const HeldTree& tree, const nb::object& models,
                  const nb::object& entry) {
  const RunRequest request = run_of(tree, models, entry, "models");
  const nb::gil_scoped_release released;
  new (devices) HeldDevices(request);
}

/// One number a device; none: 0 for all.
std::vector<double> moves_of(const nb::object& given, std::size_t count, const char* name) {
  if (given.is_none()) return std::vector<double>(count, 0);
  Numbers numbers = numbers_of(given, name);
  if (numbers.shape != std::vector{count})
    throw InputError("{}: must be {}, one a device, the outermost first", name, pluralize(count, "number"));
  return std::move(numbers.values);
}

std::vector<State> move_by(HeldDevices& devices, Motion motion, int ms) {
  constexpr int kLongest_ms = 3'600'000;
  if (ms < 1 || ms > kLongest_ms)
    throw InputError("ms {}: must be 1 to {}, whole steps of 1 ms", ms, kLongest_ms);
  for (double& angle : motion.turn_rad) angle *= kRadiansPerDegree;
  Progress progress;
  const RunningCall call(progress);
  const nb::gil_scoped_release released;
  return devices.step(motion, ms, call);
}

std::vector<State> move_hubs(HeldDevices& devices, const nb::object& push_mm, const nb::object& turn_deg,
                             int ms) {
  return move_by(
      devices,
      {moves_of(push_mm, devices.count(), "push_mm"), moves_of(turn_deg, devices.count(), "turn_deg")}, ms);
}

State move_hub(HeldCatheter& catheter, double push_mm, double turn_deg, int ms) {
  if (!std::isfinite(push_mm)) throw InputError("push_mm: must be finite");
  if (!std::isfinite(turn_deg)) throw InputError("turn_deg: must be finite");
  return move_by(catheter.held, {{push_mm}, {turn_deg}}, ms).front();
}

/// Throws InputError for a device that there is not.
std::size_t checked_device(const HeldDevices& devices, int device) {
  if (device < 0 || static_cast<std::size_t>(device) >= devices.count())
    throw InputError("device {}: must be 0 to {}, from the outermost on", device, devices.count() - 1);
  return static_cast<std::size_t>(device);
}

auto nodes_of(HeldDevices& devices, int device) {
  const std::size_t number = checked_device(devices, device);
  std::shared_ptr<std::vector<glm::dvec3>> nodes;
  {
    const nb::gil_scoped_release released;
    nodes = devices.nodes_mm(number);
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
          "The unit vector along the device at its tip.")
      .def_prop_ro(
          "branch", [](const State& s) { return s.record.tip.branch; },
          "The number of the tree's branch in which the tip is.")
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
          "is_held", [](const State& s) { return s.is_held; },
          "The hub did not advance, since the push force is 3 N already.")
      .def("__repr__", state_description);
}

std::vector<std::string> names_of(HeldDevices& devices) {
  std::vector<std::string> names;
  for (std::size_t d = 0; d < devices.count(); ++d) names.push_back(devices.name(d));
  return names;
}

void exchange_device(HeldDevices& devices, int device, const nb::object& model) {
  const std::size_t number = checked_device(devices, device);
  const std::string name = device_name(model, "model");
  const nb::gil_scoped_release released;
  devices.exchange(number, InstrumentModel::named(name));
}

void add_devices(nb::module_& module) {
  nb::class_<HeldDevices>(
      module, "CoaxialDevices",
      "Up to three devices one in the other, such as a guide wire in a catheter, each moved at "
      "its own hub. Lists have one item for each device, the outermost first.")
      .def("__init__", make_devices, nb::arg("tree"), nb::arg("models").none(), nb::kw_only(),
           nb::arg("entry") = nb::none(),
           "models: as Catheter's, a list, the outermost first; each fits into those before it.  entry: as "
           "Catheter's.")
      .def("step", move_hubs, nb::arg("push_mm") = nb::none(), nb::arg("turn_deg") = nb::none(),
           nb::arg("ms") = 1,
           "Moves each hub by its numbers in push_mm and turn_deg, evenly over `ms` steps of 1 ms, and "
           "returns a CatheterState for each device.")
      .def_prop_ro("states", &HeldDevices::states, nb::call_guard<nb::gil_scoped_release>())
      .def("nodes_mm", nodes_of, nb::arg("device"), kShared,
           "A device from the introducer to its tip, (nodes, 3) float64, mm, LPS; a new array.")
      .def(
          "exchange", exchange_device, nb::arg("device"), nb::arg("model").none(),
          "Replaces a device that is drawn back to an insertion of at most 1 mm by another model. The others "
          "stay.")
      .def(
          "has_free_lumen",
          [](HeldDevices& d, int device) { return d.has_free_lumen(checked_device(d, device)); },
          nb::arg("device"), nb::call_guard<nb::gil_scoped_release>(),
          "Whether it has a lumen with no other device inserted, so that contrast agent can be injected.")
      .def_prop_ro("shapes", &HeldDevices::shapes, nb::call_guard<nb::gil_scoped_release>(),
                   "A DeviceShape for each device now, for frames.")
      .def_prop_ro("models", names_of)
      .def_prop_ro("max_insertion_mm",
                   [](HeldDevices& d) {
                     std::vector<double> most_mm;
                     for (std::size_t i = 0; i < d.count(); ++i) most_mm.push_back(d.max_insertion_mm(i));
                     return most_mm;
                   })
      .def("__len__", &HeldDevices::count)
      .def("__repr__", [](HeldDevices& d) {
        return text_object(fmt::format("<xraycast.CoaxialDevices {}>", fmt::join(names_of(d), ", ")));
      });
}

}  // namespace

std::optional<std::vector<DeviceShape>> steered_shapes(nb::handle devices) {
  HeldDevices* held = nullptr;
  if (nb::isinstance<HeldDevices>(devices)) held = nb::cast<HeldDevices*>(devices);
  if (nb::isinstance<HeldCatheter>(devices)) held = &nb::cast<HeldCatheter*>(devices)->held;
  if (!held) return std::nullopt;
  const nb::gil_scoped_release released;
  return held->shapes();
}

void add_catheter(nb::module_& module) {
  add_state(module);
  add_devices(module);
  nb::class_<HeldCatheter>(module, "Catheter", "A catheter or guide wire in a vessel tree, moved at its hub.")
      .def("__init__", make_catheter, nb::arg("tree"), nb::arg("model"), nb::kw_only(),
           nb::arg("entry") = nb::none(),
           "model: a device's name, such as cobra-5f or guidewire-035-j (the error for a wrong one lists "
           "all), "
           "or a JSON file.\n"
           "entry: the number of a branch, or a point (x, y, z) in mm near a vessel's end; default: the most "
           "inferior end that it fits into.")
      .def("step", move_hub, nb::arg("push_mm") = 0.0, nb::arg("turn_deg") = 0.0, nb::arg("ms") = 1,
           "Moves the hub by push_mm and turn_deg, evenly over `ms` steps of 1 ms, and returns the "
           "CatheterState.")
      .def_prop_ro(
          "state", [](HeldCatheter& c) { return c.held.states().front(); },
          nb::call_guard<nb::gil_scoped_release>())
      .def_prop_ro(
          "nodes_mm", [](HeldCatheter& c) { return nodes_of(c.held, 0); }, kShared,
          "The rod from the introducer to the tip, (nodes, 3) float64, mm, LPS; a new array.")
      .def_prop_ro(
          "shape", [](HeldCatheter& c) { return c.held.shapes().front(); },
          nb::call_guard<nb::gil_scoped_release>(), "Its DeviceShape now, for frames.")
      .def_prop_ro("model", [](HeldCatheter& c) { return text_object(c.held.name(0)); })
      .def_prop_ro("max_insertion_mm", [](HeldCatheter& c) { return c.held.max_insertion_mm(0); })
      .def("__repr__", [](HeldCatheter& c) {
        return text_object(fmt::format("<xraycast.Catheter {}>", c.held.name(0)));
      });
}

}  // namespace xraycast::python
