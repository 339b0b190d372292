#include "xraycast/c/simulation.h"

#include "xraycast/base/error.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/motion/body_clock.hpp"
#include "xraycast/simulation/run.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <string>

/// With room for what is copied out, so that reading a shape allocates only when it has grown.
struct xrc_simulation {
  xraycast::Instruments instruments;
  std::optional<xraycast::BodyClock> clock;  ///< of a body that moves
  std::vector<std::string> modes;            ///< of its motion
  /// Of these the pressures, sheaths and detachments alone.
  std::array<xraycast::HubPose, xraycast::Instruments::kMaxCount> wanted;
  mutable std::vector<glm::dvec3> nodes_mm;
  mutable std::vector<xraycast::InstrumentContact> contacts;
};

namespace {

using namespace xraycast;

thread_local std::string last_error;

/// Runs a function's body; no exception leaves it.
template <typename Body>
xrc_status status_of(Body body) {
  try {
    body();
    return XRC_OK;
  } catch (const InputError& error) {
    last_error = error.what();
    return XRC_INPUT_ERROR;
  } catch (const std::bad_alloc&) {
    last_error = "not enough memory";
    return XRC_ERROR;
  } catch (const std::exception& error) {
    last_error = error.what();
    return XRC_ERROR;
  }
}

/// Throws InputError, with its name, for an argument that is NULL.
template <typename T>
T& given(T* argument, const char* name) {
  if (!argument) throw InputError("{}: NULL", name);
  return *argument;
}

/// Throws InputError where `count` values are asked for without the values.
template <typename T>
std::span<T> array_of(T* values, std::size_t count, const char* name) {
  if (!values && count > 0) throw InputError("{}: NULL, where there should be {}", name, count);
  return {values, count};
}

VesselBranch branch_of(const xrc_branch& from) {
  VesselBranch branch;
  branch.parent = from.parent;
  const std::span points = array_of(from.points, from.point_count, "points");
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double* p = points.data() + 4 * i;
    branch.points.push_back({{p[0], p[1], p[2]}, p[3]});
  }
  return branch;
}

VesselTree tree_of(const xrc_setup& setup) {
  if (setup.tree_file) return read_tree(setup.tree_file);
  std::vector<VesselBranch> branches;
  for (const xrc_branch& branch : array_of(setup.branches, setup.branch_count, "branches"))
    branches.push_back(branch_of(branch));
  return VesselTree(std::move(branches), "branches");
}

std::vector<std::string> instruments_of(const xrc_setup& setup) {
  if (setup.instrument_count > Instruments::kMaxCount)
    throw InputError("instruments: {}, at most {} can be simulated", setup.instrument_count,
                     Instruments::kMaxCount);
  std::vector<std::string> names;
  for (const char* const name : array_of(setup.instruments, setup.instrument_count, "instruments"))
    names.push_back(&given(name, "instruments"));
  return names;
}

EntryChoice entry_of(const xrc_setup& setup) {
  EntryChoice choice{.name = "entry_mm"};
  if (const double* at = setup.entry_mm) choice.end = glm::dvec3(at[0], at[1], at[2]);
  return choice;
}

Instruments::Options options_of(const xrc_setup& setup) {
  Instruments::Options options;
  if (setup.step_s != 0) options.step_s = setup.step_s;
  if (!(options.step_s >= 1e-5 && options.step_s <= 0.01))
    throw InputError("step_s: {}, which should be 0.00001 to 0.01, or 0 for a millisecond", setup.step_s);
  return options;
}

/// A body's clock, with the modes that are held.
BodyClock clock_of(const Motion& motion, const xrc_body& body) {
  if (!std::isfinite(body.start_s)) throw InputError("start_s: is not finite");
  BodyClock clock(motion, body.start_s);
  if (body.speed != 0) clock.set_speed(body.speed);
  for (const auto& [mode, phase] : array_of(body.held, body.held_count, "held"))
    clock.hold(&given(mode, "held"), phase);
  return clock;
}

/// `body` is null where it is still.
xrc_simulation* simulation_of(const xrc_setup& setup, const xrc_body* body) {
  Instruments::Options options = options_of(setup);
  std::optional<BodyClock> clock;
  if (body) {
    options.motion = std::make_shared<const Motion>(read_motion(&given(body->motion_file, "motion_file")));
    clock = clock_of(*options.motion, *body);
    options.phases = clock->phases();
  }
  const RunRequest request{.tree = std::make_shared<const VesselTree>(tree_of(setup)),
                           .instruments = instruments_named(instruments_of(setup)),
                           .entry = entry_of(setup)};
  check(request);
  return new xrc_simulation{
      Instruments(*request.tree, request.instruments, xraycast::entry_of(request), options),
      clock,
      clock ? clock->names() : std::vector<std::string>(),
      {},
      {},
      {}};
}

/// Throws InputError unless they are 0 to 1, one a mode.
std::span<const double> phases_of(std::span<const double> phases, const xrc_simulation& simulation) {
  if (phases.size() != simulation.modes.size())
    throw InputError("phases: {}, which should be {}, one a mode", phases.size(), simulation.modes.size());
  for (const double phase : phases)
    if (!(phase >= 0 && phase <= 1)) throw InputError("phases: {}, which should be 0 to 1", phase);
  return phases;
}

/// Of a simulation of a body that moves.
BodyClock& clock_of(xrc_simulation* simulation) {
  std::optional<BodyClock>& clock = given(simulation, "simulation").clock;
  if (!clock) throw InputError("simulation: its body is still; make it with xrc_create_moving()");
  return *clock;
}

using Poses = std::array<HubPose, Instruments::kMaxCount>;

/// With the pressures and sheaths that are wanted.
Poses targets_of(std::span<const xrc_hub> hubs, std::size_t count, const Poses& wanted) {
  if (hubs.size() != count)
    throw InputError("hubs: {}, which should be {}, one an instrument", hubs.size(), count);
  Poses targets = wanted;
  for (std::size_t i = 0; i < count; ++i) {
    const auto& [insertion_mm, rotation_rad] = hubs[i];
    if (!std::isfinite(insertion_mm) || !std::isfinite(rotation_rad))
      throw InputError("hubs: instrument {}'s pose is not finite", i);
    targets[i].insertion_mm = insertion_mm;
    targets[i].rotation_rad = rotation_rad;
  }
  return targets;
}

/// The simulation, which has that instrument.
const xrc_simulation& with(const xrc_simulation* simulation, std::size_t instrument) {
  const std::size_t count = given(simulation, "simulation").instruments.count();
  if (instrument >= count) throw InputError("instrument: {}, of {} counted from 0", instrument, count);
  return *simulation;
}

/// Those of the simulation, whose wire that is.
const Instruments& with_coils(const xrc_simulation* simulation, std::size_t instrument) {
  const Instruments& instruments = with(simulation, instrument).instruments;
  if (!instruments.coil_pusher(instrument).has_coils())
    throw InputError("instrument: {} has no coils", instrument);
  return instruments;
}

double not_negative(double value, const char* name) {
  if (!(value >= 0 && std::isfinite(value)))
    throw InputError("{}: {}, which should be 0 or more", name, value);
  return value;
}

void put(const glm::dvec3& from, double* to) { std::copy_n(&from.x, 3, to); }

void put(const InstrumentContact& from, xrc_contact* to) {
  put(from.position_mm, to->position_mm);
  put(from.force_N, to->force_N);
}

void put(const Treatment& from, xrc_treatment* to) {
  *to = {from.instrument,     from.is_over ? 1 : 0, from.branch,     from.from_mm,
         from.to_mm,          from.largest_bar,     from.opened_mm,  from.least_before_mm,
         from.least_after_mm, from.reference_mm,    from.occluded_s, from.stent_mm};
}

/// Copies values out, each to `width` of `room`, which holds `capacity`, and tells how many there are.
template <typename From, typename To>
void copy_out(const std::vector<From>& values, To* room, std::size_t capacity, std::size_t width,
              std::size_t& count) {
  for (std::size_t i = 0; i < std::min(capacity, values.size()); ++i) put(values[i], room + width * i);
  count = values.size();
}

}  // namespace

extern "C" {

const char* xrc_last_error() { return last_error.c_str(); }

xrc_status xrc_create(const xrc_setup* setup, xrc_simulation** simulation) {
  return status_of([&] {
    xrc_simulation*& made = given(simulation, "simulation");
    made = simulation_of(given(setup, "setup"), nullptr);
  });
}

xrc_status xrc_create_moving(const xrc_setup* setup, const xrc_body* body, xrc_simulation** simulation) {
  return status_of([&] {
    xrc_simulation*& made = given(simulation, "simulation");
    made = simulation_of(given(setup, "setup"), &given(body, "body"));
  });
}

void xrc_destroy(xrc_simulation* simulation) { delete simulation; }

xrc_status xrc_step(xrc_simulation* simulation, const xrc_hub* hubs, size_t hub_count) {
  return status_of([&] {
    auto& [instruments, clock, modes, wanted, nodes, touching] = given(simulation, "simulation");
    const std::array targets = targets_of(array_of(hubs, hub_count, "hubs"), instruments.count(), wanted);
    if (clock) clock->advance(instruments.step_s());
    instruments.step(std::span(targets).first(instruments.count()),
                     clock ? clock->phases() : std::vector<double>());
  });
}

xrc_status xrc_step_at(xrc_simulation* simulation, const xrc_hub* hubs, size_t hub_count,
                       const double* phases, size_t phase_count) {
  return status_of([&] {
    Instruments& instruments = given(simulation, "simulation").instruments;
    const std::array targets =
        targets_of(array_of(hubs, hub_count, "hubs"), instruments.count(), simulation->wanted);
    instruments.step(std::span(targets).first(instruments.count()),
                     phases_of(array_of(phases, phase_count, "phases"), *simulation));
  });
}

xrc_status xrc_hold(xrc_simulation* simulation, const char* mode) {
  return status_of([&] { clock_of(simulation).hold(&given(mode, "mode")); });
}

xrc_status xrc_release(xrc_simulation* simulation, const char* mode) {
  return status_of([&] { clock_of(simulation).release(&given(mode, "mode")); });
}

xrc_status xrc_get_phases(const xrc_simulation* simulation, double* phases, size_t capacity, size_t* count) {
  return status_of([&] {
    const std::span<const double> now = given(simulation, "simulation").instruments.phases();
    size_t& phase_count = given(count, "count");
    array_of(phases, capacity, "phases");
    std::copy_n(now.begin(), std::min(capacity, now.size()), phases);
    phase_count = now.size();
  });
}

xrc_status xrc_get_mode(const xrc_simulation* simulation, size_t mode, const char** name) {
  return status_of([&] {
    const std::vector<std::string>& modes = given(simulation, "simulation").modes;
    if (mode >= modes.size()) throw InputError("mode: {}, of {} counted from 0", mode, modes.size());
    given(name, "name") = modes[mode].c_str();
  });
}

xrc_status xrc_get_tip_in_scan(const xrc_simulation* simulation, size_t instrument, double position_mm[3]) {
  return status_of([&] {
    const InstrumentTip tip = with(simulation, instrument).instruments.tip(instrument);
    put(tip.scan_mm, &given(position_mm, "position_mm"));
  });
}

xrc_status xrc_get_hub(const xrc_simulation* simulation, size_t instrument, xrc_hub* hub) {
  return status_of([&] {
    const HubPose& pose = with(simulation, instrument).instruments.pose(instrument);
    given(hub, "hub") = {pose.insertion_mm, pose.rotation_rad};
  });
}

xrc_status xrc_get_load(const xrc_simulation* simulation, size_t instrument, xrc_load* load) {
  return status_of([&] {
    const auto [force_N, torque_Nm] = with(simulation, instrument).instruments.load(instrument);
    given(load, "load") = {force_N, torque_Nm};
  });
}

xrc_status xrc_get_tip(const xrc_simulation* simulation, size_t instrument, xrc_tip* tip) {
  return status_of([&] {
    const InstrumentTip from = with(simulation, instrument).instruments.tip(instrument);
    xrc_tip& to = given(tip, "tip");
    put(from.position_mm, to.position_mm);
    put(from.direction, to.direction);
    to.branch = from.branch;
    to.arc_length_mm = from.arc_length_mm;
  });
}

xrc_status xrc_get_shape(const xrc_simulation* simulation, size_t instrument, double* nodes_mm,
                         size_t capacity, size_t* count) {
  return status_of([&] {
    const auto& [instruments, clock, modes, wanted, nodes, touching] = with(simulation, instrument);
    size_t& node_count = given(count, "count");
    array_of(nodes_mm, capacity, "nodes_mm");
    instruments.copy_nodes(instrument, nodes);
    copy_out(nodes, nodes_mm, capacity, 3, node_count);
  });
}

xrc_status xrc_get_contacts(const xrc_simulation* simulation, size_t instrument, xrc_contact* contacts,
                            size_t capacity, size_t* count) {
  return status_of([&] {
    const auto& [instruments, clock, modes, wanted, nodes, touching] = with(simulation, instrument);
    size_t& contact_count = given(count, "count");
    array_of(contacts, capacity, "contacts");
    instruments.copy_contacts(instrument, touching);
    copy_out(touching, contacts, capacity, 1, contact_count);
  });
}

xrc_status xrc_exchange(xrc_simulation* simulation, size_t instrument, const char* name_or_file) {
  return status_of([&] {
    with(simulation, instrument);
    simulation->instruments.exchange(instrument,
                                     InstrumentModel::named(&given(name_or_file, "name_or_file")));
    simulation->wanted[instrument] = {};
  });
}

xrc_status xrc_inflate(xrc_simulation* simulation, size_t instrument, double bar) {
  return status_of([&] {
    with(simulation, instrument);
    simulation->wanted[instrument].inflation_bar = not_negative(bar, "bar");
  });
}

xrc_status xrc_detach(xrc_simulation* simulation, size_t instrument) {
  return status_of([&] {
    with_coils(simulation, instrument);
    ++simulation->wanted[instrument].detach;
  });
}

xrc_status xrc_get_coil(const xrc_simulation* simulation, size_t instrument, xrc_coil* coil) {
  return status_of([&] {
    const Instruments& instruments = with_coils(simulation, instrument);
    const std::optional<PushedCoil> pushed = instruments.pushed_coil(instrument);
    const RunRecord::Coil state = coil_of(instruments, instrument).value();
    xrc_coil& to = given(coil, "coil");
    to = {};
    to.detached = state.detached;
    to.packing = state.packing;
    if (!pushed) return;
    to.loop_mm = pushed->model.loop_mm;
    to.length_mm = pushed->model.length_mm;
    to.laid_mm = pushed->laid_mm;
    to.is_outside = pushed->is_outside();
    to.can_be_detached = pushed->can_be_detached();
  });
}

xrc_status xrc_draw_sheath(xrc_simulation* simulation, size_t instrument, double mm) {
  return status_of([&] {
    with(simulation, instrument);
    simulation->wanted[instrument].release_mm = not_negative(mm, "mm");
  });
}

xrc_status xrc_get_device(const xrc_simulation* simulation, size_t instrument, xrc_device* device) {
  return status_of([&] {
    const Instruments& instruments = with(simulation, instrument).instruments;
    const bool has_balloon = instruments.rod(instrument).instrument().balloon().has_value();
    given(device, "device") = {
        instruments.balloon_bar(instrument), has_balloon ? 2 * instruments.balloon_radius_mm(instrument) : 0,
        instruments.pose(instrument).release_mm, instruments.carried_rings(instrument)};
  });
}

xrc_status xrc_get_treatments(const xrc_simulation* simulation, xrc_treatment* treatments, size_t capacity,
                              size_t* count) {
  return status_of([&] {
    const Instruments& instruments = given(simulation, "simulation").instruments;
    size_t& treatment_count = given(count, "count");
    array_of(treatments, capacity, "treatments");
    copy_out(instruments.treatments().list(), treatments, capacity, 1, treatment_count);
  });
}
}
