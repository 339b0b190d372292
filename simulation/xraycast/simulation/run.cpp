#include "xraycast/simulation/run.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/negative_zero.hpp"
#include "xraycast/mechanics/vectors.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace xraycast {
namespace {

constexpr double kRounding_s = 1e-9;       // by which times of steps and rows differ
constexpr double kLeastInterval_s = 1e-3;  // a step

RunRecord record_of(double time_s, const Instruments& instruments, std::size_t d) {
  RunRecord record{.time_s = time_s,
                   .pose = instruments.pose(d),
                   .load = instruments.load(d),
                   .tip = instruments.tip(d),
                   .wall_work_J = instruments.wall_work_J(d),
                   .balloon_bar = instruments.balloon_bar(d),
                   .balloon_mm = 2 * instruments.balloon_radius_mm(d),
                   .free_rings = {},
                   .coil = coil_of(instruments, d),
                   .phases = {}};
  if (const InstrumentModel& model = instruments.rod(d).instrument(); model.has_sheath())
    record.free_rings = model.stent()->rings - instruments.carried_rings(d);
  record.phases.assign(instruments.phases().begin(), instruments.phases().end());
  for (const WallContact::Contact& contact : instruments.wall(d).contacts()) {
    if (contact.depth_mm <= 0) continue;
    ++record.contacts;
    record.contact_force_N += (contact.normal_N + contact.friction_N).norm();
    record.deepest_mm = std::max(record.deepest_mm, contact.depth_mm);
  }
  return record;
}

// ---- the check

/// What `entry` takes to choose an end: a name that no other end has, or a number. A branch with two ends is
/// chosen at its start.
std::string choice_of(const VesselTree& tree, const VesselEnd& end) {
  const auto name_of = [&](const VesselEnd& of) {
    return tree.branches()[static_cast<std::size_t>(of.branch)].name;
  };
  const std::string name = name_of(end);
  const std::vector<VesselEnd> ends = vessel_ends(tree);
  if (!name.empty() && std::ranges::count(ends, name, name_of) == 1)
    return fmt::format("`entry` \"{}\"", name);
  if (end.at_start || end.branch != tree.root()) return fmt::format("`entry` {}", end.branch);
  const auto mm = [&](int axis) { return no_negative_zero(end.position_mm[axis], 0); };
  return fmt::format("`entry` {:.0f},{:.0f},{:.0f}", mm(0), mm(1), mm(2));
}

/// Where the entry is not chosen and other ends lie about as low as the one found.
std::vector<std::string> notes_on_entry(const RunRequest& request, const VesselEnd& entry) {
  if (!std::holds_alternative<std::monostate>(request.entry.end)) return {};
  constexpr std::size_t kMostNamed = 3;
  std::vector<VesselEnd> others = equally_low_ends(*request.tree, entry, request.instruments.front());
  if (others.empty()) return {};
  if (others.size() > kMostNamed) others.resize(kMostNamed);
  std::string names, choices = choice_of(*request.tree, entry);
  for (const VesselEnd& other : others) {
    names += fmt::format("{}{}", names.empty() ? "" : "; or ", text_of(*request.tree, other));
    choices += " or " + choice_of(*request.tree, other);
  }
  return {
      fmt::format("vessel ends lie equally low, within {:g} mm: the instrument enters at {}, and not at {}; "
                  "choose by {}",
                  kEquallyLow_mm, text_of(*request.tree, entry), names, choices)};
}

void check_lengths(const Script& script, const std::vector<InstrumentModel>& instruments) {
  for (std::size_t r = 0; r < script.rows().size(); ++r)
    for (std::size_t d = 0; d < instruments.size(); ++d) {
      const double insertion_mm = script.rows()[r].pose_of(d).insertion_mm;
      if (insertion_mm > max_insertion_mm(instruments[d]))
        throw InputError("{}: {} {}; {} can be inserted by at most {:.0f} mm", script.where(r),
                         insertion_column(d), insertion_mm, instruments[d].name(),
                         max_insertion_mm(instruments[d]));
    }
}

void check_inflations(const Script& script, const std::vector<InstrumentModel>& instruments) {
  for (std::size_t r = 0; r < script.rows().size(); ++r)
    for (std::size_t d = 0; d < instruments.size(); ++d) {
      const double bar = script.rows()[r].pose_of(d).inflation_bar;
      if (bar <= instruments[d].max_inflation_bar()) continue;
      const std::string pressure = fmt::format("{}: {} {}", script.where(r), inflation_column(d), bar);
      if (!instruments[d].balloon())
        throw InputError("{}; {} has no balloon: leave the column out, or take balloon-6x20, say", pressure,
                         instruments[d].name());
      throw InputError("{}; the balloon of {} is rated to {:g} bar: inflate it by no more", pressure,
                       instruments[d].name(), instruments[d].max_inflation_bar());
    }
}

void check_releases(const Script& script, const std::vector<InstrumentModel>& instruments) {
  for (std::size_t r = 0; r < script.rows().size(); ++r)
    for (std::size_t d = 0; d < instruments.size(); ++d) {
      const double release_mm = script.rows()[r].pose_of(d).release_mm;
      if (release_mm <= instruments[d].max_release_mm()) continue;
      const std::string drawn = fmt::format("{}: {} {}", script.where(r), release_column(d), release_mm);
      if (!instruments[d].has_sheath())
        throw InputError(
            "{}; {} has no stent in a sheath: leave the column out, or take stent-self-8x40, say", drawn,
            instruments[d].name());
      throw InputError("{}; the stent of {} is {:.1f} mm long in its sheath: draw that back by no more",
                       drawn, instruments[d].name(), std::floor(10 * instruments[d].max_release_mm()) / 10);
    }
}

void check_detachments(const Script& script, const std::vector<InstrumentModel>& instruments) {
  for (std::size_t r = 0; r < script.rows().size(); ++r)
    for (std::size_t d = 0; d < instruments.size(); ++d)
      if (const double count = script.rows()[r].pose_of(d).detach; count > 0 && !instruments[d].has_coils())
        throw InputError("{}: {} {:g}; {} has no coils: leave the column out, or take coil-10x30, say",
                         script.where(r), detach_column(d), count, instruments[d].name());
}

/// The largest sac of the tree has room for each of them, and is as wide as its loops or nearly so.
void check_coils(const RunRequest& request) {
  constexpr double kWider = 1.5, kPercent = 100;
  for (const InstrumentModel& model : request.instruments) {
    if (!model.has_coils()) continue;
    std::optional<AneurysmSac> largest;
    for (const AneurysmSac& sac : sacs_of(*request.tree))
      if (!largest || sac.radius_mm > largest->radius_mm) largest = sac;
    if (!largest)
      throw InputError(
          "{}: the tree has no aneurysm that its coils could fill; add one by `xraycast edit --aneurysm`",
          model.name());
    for (const CoilModel& coil : model.coils()) {
      if (coil.loop_mm > kWider * 2 * largest->radius_mm)
        throw InputError(
            "{}: loops of {:g} mm are too wide for the tree's widest aneurysm, {:.1f} mm; take a smaller "
            "coil",
            model.name(), coil.loop_mm, 2 * largest->radius_mm);
      if (const double share = coil.volume_mm3() / largest->volume_mm3(); share > CoilPack::kDensest)
        throw InputError(
            "{}: a coil of {:g} mm would fill {:.0f} % of the tree's widest aneurysm, and {:.0f} % is the "
            "most; take a shorter one",
            model.name(), coil.length_mm, kPercent * share, kPercent * CoilPack::kDensest);
    }
  }
}

void check_stents(const RunRequest& request) {
  double longest_mm = 0;
  for (const VesselBranch& branch : request.tree->branches())
    longest_mm = std::max(longest_mm, branch.arc_length_mm.back());
  for (const InstrumentModel& model : request.instruments)
    if (model.stent() && model.stent()->length_mm > longest_mm)
      throw InputError(
          "{}: its stent of {:g} mm is longer than any vessel of the tree, {:.1f} mm at most; take a shorter "
          "one",
          model.name(), model.stent()->length_mm, longest_mm);
}

void check_injection(const RunRequest& request) {
  const Injection& injection = request.injection;
  check(injection);
  if (injection.volume_ml() == 0) return;
  const std::string name = fmt::format("`inject` {:g},{:g}", injection.from_s, injection.to_s);
  if (request.instruments.front().inner_radius_mm() == 0)
    throw InputError("{}: {} has no lumen; leave `inject` out, or give a catheter by `instruments` before it",
                     name, request.instruments.front().name());
  double widest_mm = 0;
  for (const InstrumentModel& model : request.instruments)
    widest_mm = std::max(widest_mm, 2 * model.inner_radius_mm());
  if (injection.particles.diameter_mm >= widest_mm)
    throw InputError("`particles_mm` {:g}: they pass no lumen, whose widest is {:.2f} mm; take smaller ones",
                     injection.particles.diameter_mm, widest_mm);
  const double end_s = request.script ? request.script->rows().back().time_s : 0;
  if (injection.from_s >= end_s && end_s > 0)
    throw InputError("{}: begins after the end of {} at {:g} s; inject earlier", name,
                     request.script->origin(), end_s);
}

/// How far the body takes a place away from where it is at 0 s, at any key of a mode.
double moves_mm(const RunRequest& request, const glm::dvec3& in_scan_mm) {
  const Motion& motion = *request.body.motion;
  const std::vector<double> start = phases_at(request.body, 0);
  const glm::dvec3 start_mm = motion.held_at(start).inverse_mm(in_scan_mm).x_mm;
  double furthest_mm = 0;
  for (std::size_t m = 0; m < start.size(); ++m) {
    if (request.body.phase.contains(motion.modes()[m].name)) continue;
    for (const KeyPhase& key : motion.modes()[m].keys) {
      std::vector<double> phases = start;
      phases[m] = key.phase;
      furthest_mm = std::max(
          furthest_mm, glm::distance(start_mm, motion.held_at(phases).inverse_mm(in_scan_mm, start_mm).x_mm));
    }
  }
  return furthest_mm;
}

/// Throws InputError; returns a note where the entry moves.
std::vector<std::string> check_motion(const RunRequest& request, const VesselEnd& entry) {
  check(request.body);
  if (!request.body.motion) return {};
  constexpr double kNoticed_mm = 1;
  const double away_mm = moves_mm(request, to_glm(entry.position_mm));
  if (away_mm < kNoticed_mm) return {};
  return {
      fmt::format("the motion takes the vessel's end where the instruments enter {:.0f} mm away from the "
                  "introducer, which stays; enter where the body moves less",
                  away_mm)};
}

// ---- the run

/// Steps through a script's rows; `step` takes a time of the script, `record` a row.
void follow(const Script& script, double step_s, Progress& progress,
            const std::function<void(double time_s)>& step,
            const std::function<void(const Script::Row& row)>& record) {
  long steps = 0;
  progress.begin("simulating", static_cast<std::int64_t>(script.rows().size()), "rows");
  for (const Script::Row& row : script.rows()) {
    while (static_cast<double>(steps) * step_s < row.time_s - kRounding_s) {
      progress.check();
      ++steps;
      step(static_cast<double>(steps) * step_s);
    }
    record(row);
    progress.advance();
  }
}

/// Though its hub has a pressure.
bool keeps_balloon_folded(const Instruments& instruments) {
  for (std::size_t d = 0; d < instruments.count(); ++d)
    if (instruments.pose(d).inflation_bar > 0 && instruments.balloon_bar(d) == 0) return true;
  return false;
}

/// Though its sheath is drawn back from a ring of it.
bool keeps_stent(const Instruments& instruments) {
  for (std::size_t d = 0; d < instruments.count(); ++d) {
    const InstrumentModel& model = instruments.rod(d).instrument();
    if (model.has_sheath() && instruments.carried_rings(d) == model.stent()->rings &&
        instruments.pose(d).release_mm >= model.stent()->ring_height_mm(model.crimped_mm()))
      return true;
  }
  return false;
}

/// Of stents that reach beyond the ends of their vessels, as branches of the tree, and of those that are not
/// free.
std::vector<std::string> notes_on_stents(const Instruments& instruments) {
  constexpr double kNoticed_mm = 0.5;
  std::vector<std::string> notes;
  for (const Treatment& treatment : instruments.treatments().list())
    if (treatment.sheathed_rings > 0)
      notes.push_back(
          fmt::format("{}: {} of the {} rings of its stent are in the sheath still; draw it back further",
                      treatment.device, treatment.sheathed_rings, treatment.stent->rings));
  for (const PlacedStent& stent : instruments.treatments().stents()) {
    const VesselTree& tree = instruments.tree();
    const double length_mm = tree.branches()[static_cast<std::size_t>(stent.branch)].arc_length_mm.back();
    const double beyond_mm = std::max(-stent.from_mm(), stent.to_mm() - length_mm);
    if (beyond_mm > kNoticed_mm)
      notes.push_back(fmt::format(
          "{}: its stent of {:.1f} mm reaches {:.1f} mm beyond the end of {}, where it holds no wall; "
          "take a shorter one, or place it further inside",
          instruments.treatments().list()[stent.treatment].device, stent.length_mm(), beyond_mm,
          tree.title(stent.branch)));
  }
  return notes;
}

/// On coils that were not detached as they were to be, or held back where there is no sac.
std::vector<std::string> notes_on_coils(const Instruments& instruments) {
  constexpr double kNoticed_s = 0.05;
  std::vector<std::string> notes;
  for (std::size_t d = 0; d < instruments.count(); ++d) {
    const CoilPusher& pusher = instruments.coil_pusher(d);
    const std::string& name = instruments.rod(d).instrument().name();
    for (const CoilPusher::Refused& refused : pusher.refused)
      notes.push_back(refused.length_mm > 0 ? fmt::format("{}: a coil was not detached, because only {:.0f} "
                                                          "of its {:.0f} mm lay in an aneurysm; push "
                                                          "all of it out of its catheter there first",
                                                          name, refused.laid_mm, refused.length_mm)
                                            : fmt::format("{}: no coil was detached, because none was on the "
                                                          "wire; draw it back to 0 for the next one",
                                                          name));
    if (pusher.held_back_s >= kNoticed_s)
      notes.push_back(
          fmt::format("{}: its coil was held back for {:.1f} s, because the tip that it comes out of was in "
                      "no aneurysm; lead that tip into one first",
                      name, pusher.held_back_s));
  }
  return notes;
}

/// On balloons, stents and hubs that did not go on.
std::vector<std::string> notes_on_waiting(const Run& run) {
  std::vector<std::string> notes;
  constexpr double kNoticed_s = 0.05;
  if (run.not_inflated_s >= kNoticed_s)
    notes.push_back(fmt::format(
        "a balloon stayed folded for {:.1f} s, because it was not wholly beyond the introducer and "
        "the instruments around it; advance it before it is inflated",
        run.not_inflated_s));
  if (run.not_released_s >= kNoticed_s)
    notes.push_back(fmt::format(
        "a stent stayed in its sheath for {:.1f} s, because it was not wholly beyond the introducer and the "
        "instruments around it; advance it before the sheath is drawn back",
        run.not_released_s));
  if (run.held_s >= kNoticed_s)
    notes.push_back(
        fmt::format("the hub did not advance for {:.1f} s, because the push force would have exceeded {:g} N",
                    run.held_s, MovingHub::kMaxPush_N));
  return notes;
}

std::vector<std::string> notes_on_injection(const RunRequest& request, const InjectedVolume& injected) {
  constexpr double kNoticed_ml = 0.05;
  std::vector<std::string> notes;
  if (injected.withheld_ml() >= kNoticed_ml)
    notes.push_back(fmt::format("{:.1f} ml of contrast agent were not injected: {}", injected.withheld_ml(),
                                reason_for_no_outlet(request.instruments)));
  if (injected.strained_ml() >= kNoticed_ml)
    notes.push_back(
        fmt::format("{:.1f} ml of contrast agent were injected without particles: those of {:g} "
                    "mm do not pass the lumen; take smaller ones",
                    injected.strained_ml(), request.injection.particles.diameter_mm));
  return notes;
}

bool is_at(const HubPose& hub, const HubPose& pose) {
  return hub.insertion_mm == pose.insertion_mm && hub.rotation_rad == pose.rotation_rad &&
         hub.inflation_bar == pose.inflation_bar && hub.release_mm == pose.release_mm &&
         hub.detach == pose.detach;
}

/// Watches hubs on their way to a row's poses.
class Approach {
 public:
  Approach(const Script::Row& row, std::size_t instruments)
      : row_(row),
        nearest_mm_(instruments, std::numeric_limits<double>::infinity()),
        since_s_(instruments),
        is_pushed_(instruments) {}

  bool is_over(const Instruments& instruments) const {
    for (std::size_t d = 0; d < instruments.count(); ++d)
      if (!is_at(instruments.pose(d), row_.pose_of(d))) return false;
    return true;
  }

  /// Throws InputError when a hub has come no nearer for long.
  void check(const Instruments& instruments, double time_s, const std::string& where) {
    constexpr double kLongest_s = 5, kNearer_mm = 0.1;
    for (std::size_t d = 0; d < instruments.count(); ++d) {
      const double insertion_mm = instruments.pose(d).insertion_mm;
      const double left_mm = std::abs(row_.pose_of(d).insertion_mm - insertion_mm);
      is_pushed_[d] = is_pushed_[d] || instruments.is_held(d);
      if (left_mm < nearest_mm_[d] - kNearer_mm || left_mm == 0) {
        nearest_mm_[d] = left_mm;
        since_s_[d] = time_s;
        is_pushed_[d] = false;
      } else if (time_s - since_s_[d] > kLongest_s) {
        throw InputError("{}: {} stops at {:.0f} of {:.0f} mm{}; begin with less", where,
                         instruments.rod(d).instrument().name(), insertion_mm, row_.pose_of(d).insertion_mm,
                         is_pushed_[d]
                             ? fmt::format(", where {:g} N do not push it further", MovingHub::kMaxPush_N)
                             : std::string());
      }
    }
  }

 private:
  const Script::Row& row_;
  std::vector<double> nearest_mm_, since_s_;  ///< of each instrument
  std::vector<bool> is_pushed_;               ///< against more than its hub pushes, since then
};

double pressure_interval_s(const Script& script) {
  constexpr double kFinest_s = 0.01;
  return kFinest_s * std::max(1.0, std::ceil(script.rows().back().time_s / Run::kPressures_s));
}

PressureSample sample_of(const Instruments& instruments, double time_s, const InstrumentPressures& blood) {
  PressureSample sample{time_s, blood.aortic_mmHg(), {}};
  for (std::size_t d = 0; d < instruments.count(); ++d)
    sample.tips_mmHg.push_back(blood.tip_mmHg(instruments, d));
  return sample;
}

constexpr const char* kColumns =
    "insertion{0}_mm,rotation{0}_deg,force{0}_N,torque{0}_Nm,tip{0}_x_mm,tip{0}_y_mm,tip{0}_z_mm,tip{0}_"
    "direction_x,tip{0}_direction_y,tip{0}_direction_z,tip{0}_branch,tip{0}_arc_length_mm,contacts{0},"
    "contact_force{0}_N,deepest{0}_mm,pressure{0}_mmHg";
constexpr const char* kMotionColumns = ",tip{0}_scan_x_mm,tip{0}_scan_y_mm,tip{0}_scan_z_mm,wall_work{0}_J";

constexpr const char* kBalloonColumns = ",inflation{0}_bar,balloon{0}_mm";
constexpr const char* kSheathColumns = ",release{0}_mm,free_rings{0}";
constexpr const char* kCoilColumns = ",coil{0}_mm,detached{0},packing{0}";

double part(double value) {
  constexpr int kDecimals = 6;
  return no_negative_zero(value, kDecimals);
}

std::string values_of(const RunRecord& r) {
  const glm::dvec3 &p = r.tip.position_mm, &d = r.tip.direction;
  // A sum with +0 is never -0.
  return fmt::format(
      "{:.6g},{:.6g},{:.6g},{:.6g},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{:.6f},{},{:.6f},{},{:.6g},{:.6g},{:."
      "6g}",
      r.pose.insertion_mm + 0.0, r.pose.rotation_rad * 180 / std::numbers::pi + 0.0, r.load.force_N + 0.0,
      r.load.torque_Nm + 0.0, part(p.x), part(p.y), part(p.z), part(d.x), part(d.y), part(d.z), r.tip.branch,
      part(r.tip.arc_length_mm), r.contacts, r.contact_force_N, r.deepest_mm, r.pressure_mmHg);
}

std::string motion_values_of(const RunRecord& r) {
  const glm::dvec3& p = r.tip.scan_mm;
  return fmt::format(",{:.6f},{:.6f},{:.6f},{:.6g}", part(p.x), part(p.y), part(p.z), r.wall_work_J + 0.0);
}

std::string columns_of(const char* columns, std::size_t instrument) {
  return fmt::format(fmt::runtime(columns), instrument == 0 ? "" : fmt::format("_{}", instrument + 1));
}

}  // namespace

std::vector<InstrumentModel> instruments_named(const std::vector<std::string>& names) {
  std::vector<InstrumentModel> instruments;
  for (const std::string& name : names) instruments.push_back(InstrumentModel::named(name));
  return instruments;
}

std::vector<std::string> check(const RunRequest& request) {
  if (!request.tree)
    throw InputError("`tree`: missing; a run needs a vessel tree, such as `xraycast segment` writes");
  check_instruments(request.instruments);
  const VesselEnd entry = entry_of(request);
  check_fits(*request.tree, entry, request.instruments.front());
  if (!(request.interval_s == 0 ||
        (request.interval_s >= kLeastInterval_s && std::isfinite(request.interval_s))))
    throw InputError("`interval_s` {:g}: must be 0, for the script's rows, or {:g} s or more",
                     request.interval_s, kLeastInterval_s);
  if (request.script) {
    check_lengths(*request.script, request.instruments);
    check_inflations(*request.script, request.instruments);
    check_releases(*request.script, request.instruments);
    check_detachments(*request.script, request.instruments);
  }
  check_stents(request);
  check_coils(request);
  check_injection(request);
  check(request.blood);
  std::vector<std::string> notes = notes_on_entry(request, entry);
  for (std::string& note : check_motion(request, entry)) notes.push_back(std::move(note));
  return notes;
}

Instruments::Options instrument_options(const RunRequest& request) {
  return {.motion = request.body.motion, .phases = phases_at(request.body, 0)};
}

VesselEnd entry_of(const RunRequest& request) {
  return find_entry(*request.tree, request.entry, request.instruments.front());
}

std::string text_of(const VesselTree& tree, const VesselEnd& end) {
  const std::string_view side = side_of_patient(tree, end);
  const auto mm = [&](int axis) { return no_negative_zero(end.position_mm[axis], 1); };
  return fmt::format("{} at ({:.1f}, {:.1f}, {:.1f}) mm{}{}", tree.title(end.branch), mm(0), mm(1), mm(2),
                     side.empty() ? "" : ", on the patient's ", side);
}

/// Of a treatment beside the stenosis.
std::string missed_in_words(const Treatment& treatment, const VesselTree& tree) {
  constexpr double kNarrower = 0.9;
  const double at_mm = treatment.middle_mm - treatment.off_narrowest_mm;
  if (at_mm >= treatment.from_mm && at_mm <= treatment.to_mm) return "";
  const VesselBranch& branch = tree.branches()[static_cast<std::size_t>(treatment.branch)];
  const double there_mm = 2 * point_at(branch, at_mm).radius_mm;
  if (there_mm >= kNarrower * treatment.least_before_mm) return "";
  return fmt::format(
      "; it was {:.0f} to {:.0f} mm along the vessel, but the narrowest place, {:.2f} mm, lies at "
      "{:.0f} mm",
      treatment.from_mm, treatment.to_mm, there_mm, at_mm);
}

std::string in_words(const Treatment& treatment, const VesselTree& tree) {
  constexpr double kPercent = 100;
  const std::string stent =
      treatment.stent && treatment.is_over
          ? fmt::format("; stent of {:.2f} by {:.1f} mm, at most {:.2f} mm off the wall", treatment.stent_mm,
                        treatment.stent_length_mm, treatment.malapposition.largest_mm)
          : "";
  const std::string occluded =
      treatment.occluded_s > 0 ? fmt::format("; no flow for {:.1f} s", treatment.occluded_s) : "";
  const std::string opened =
      treatment.is_release()
          ? fmt::format("{:.3g} mm, presses by {:.2f} N/mm", treatment.opened_mm, treatment.outward_N_mm)
          : fmt::format("{:.3g} mm at {:.3g} bar", treatment.opened_mm, treatment.largest_bar);
  return fmt::format(
             "{} in {}: {}; least diameter {:.2f} mm before, {:.2f} mm after, of {:.2f} "
             "mm: "
             "residual stenosis {:.0f} %",
             treatment.device, tree.title(treatment.branch), opened, treatment.least_before_mm,
             treatment.least_after_mm, treatment.reference_mm,
             no_negative_zero(kPercent * treatment.residual_stenosis(), 0)) +
         missed_in_words(treatment, tree) + stent + occluded;
}

std::optional<RunRecord::Coil> coil_of(const Instruments& instruments, std::size_t d) {
  const CoilPusher& pusher = instruments.coil_pusher(d);
  if (!pusher.has_coils()) return {};
  RunRecord::Coil coil{.detached = pusher.detached};
  double last_s = -1;
  for (const CoilPack& pack : instruments.coil_packs())
    for (const LaidCoil& laid : pack.coils()) {
      if (laid.instrument != d || laid.from_s < last_s) continue;
      last_s = laid.from_s;
      coil.packing = pack.packing();
      coil.out_mm = laid.is_detached ? 0 : laid.laid_mm;
    }
  return coil;
}

std::vector<RunRecord> records_of(const Instruments& instruments, double time_s,
                                  const InstrumentPressures* blood) {
  std::vector<RunRecord> records;
  for (std::size_t d = 0; d < instruments.count(); ++d) {
    records.push_back(record_of(time_s, instruments, d));
    if (!blood) continue;
    records.back().pressure_mmHg = blood->tip_mmHg(instruments, d);
    records.back().aortic_mmHg = blood->aortic_mmHg();
  }
  return records;
}

RunUse with_blood(RunUse use, const RunRequest& request, const InstrumentPressures& blood) {
  if (request.injection.volume_ml() > 0) use.contrast_ml = blood.injected().injected_ml();
  use.tips_mmHg = blood.readings().tip_means_mmHg();
  return use;
}

Run run(const RunRequest& request, Progress& progress, const RunListener& listener) {
  check(request);
  if (!request.script) throw InputError("`script`: missing; without a hand it moves the hubs");
  const Script& script = *request.script;
  Run run{.entry = entry_of(request), .records = {}, .last = {}};
  if (request.body.motion)
    for (const MotionMode& mode : request.body.motion->modes()) run.modes.push_back(mode.name);
  Instruments instruments(*request.tree, request.instruments, run.entry, instrument_options(request));
  std::vector<HubPose> poses(instruments.count());
  const auto move_to = [&](double time_s, const std::vector<double>& phases) {
    for (std::size_t d = 0; d < poses.size(); ++d) poses[d] = script.pose_at(time_s, d);
    instruments.step(poses, phases);
  };
  const Script::Row& first = script.rows().front();
  for (Approach approach(first, instruments.count()); !approach.is_over(instruments);) {
    progress.check();
    move_to(first.time_s, phases_at(request.body, 0));
    approach.check(instruments, instruments.time_s(), script.where(0));
  }

  InstrumentPressures blood(*request.tree, request.blood);
  const double sample_s = pressure_interval_s(script);
  const auto tell = [&](double time_s) {
    blood.advance(instruments, time_s, request.injection);
    if (time_s >= static_cast<double>(run.pressures.size()) * sample_s - kRounding_s)
      run.pressures.push_back(sample_of(instruments, time_s, blood));
    if (listener) listener(instruments, time_s, blood);
    const double next_s = static_cast<double>(run.records.size()) * request.interval_s;
    if (request.interval_s > 0 && time_s >= next_s - kRounding_s)
      run.records.push_back(records_of(instruments, time_s, &blood));
  };
  const auto step = [&](double time_s) {
    move_to(time_s, phases_at(request.body, time_s));
    if (instruments.is_held()) run.held_s += instruments.step_s();
    if (keeps_balloon_folded(instruments)) run.not_inflated_s += instruments.step_s();
    if (keeps_stent(instruments)) run.not_released_s += instruments.step_s();
    tell(time_s);
  };
  tell(0);
  follow(script, instruments.step_s(), progress, step, [&](const Script::Row& row) {
    if (request.interval_s == 0) run.records.push_back(records_of(instruments, row.time_s, &blood));
  });
  run.last = records_of(instruments, instruments.time_s(), &blood);
  run.treatments = instruments.treatments().list();
  run.coilings = coilings_of(instruments, flows_past_sacs(*request.tree));
  run.embolised = blood.embolisation().list();
  run.injected_ml = blood.injected().injected_ml();
  run.withheld_ml = blood.injected().withheld_ml();
  run.notes = notes_on_stents(instruments);
  for (std::string& note : notes_on_coils(instruments)) run.notes.push_back(std::move(note));
  for (std::string& note : notes_on_injection(request, blood.injected()))
    run.notes.push_back(std::move(note));
  for (std::string& note : notes_on_waiting(run)) run.notes.push_back(std::move(note));
  return run;
}

std::string to_csv(const Run& run) {
  const bool moves = !run.modes.empty();
  std::string csv = "time_s";
  for (const std::string& mode : run.modes) csv += fmt::format(",phase_{}", mode);
  for (std::size_t d = 0; !run.records.empty() && d < run.records.front().size(); ++d) {
    csv += fmt::format(",{}", columns_of(kColumns, d));
    if (moves) csv += columns_of(kMotionColumns, d);
    if (run.records.front()[d].balloon_mm > 0) csv += columns_of(kBalloonColumns, d);
    if (run.records.front()[d].free_rings) csv += columns_of(kSheathColumns, d);
    if (run.records.front()[d].coil) csv += columns_of(kCoilColumns, d);
  }
  if (!run.records.empty()) csv += ",aortic_mmHg";
  csv += '\n';
  for (const std::vector<RunRecord>& row : run.records) {
    csv += fmt::format("{:.6g}", row.front().time_s);
    for (const double phase : row.front().phases) csv += fmt::format(",{:.6g}", phase);
    for (const RunRecord& record : row) {
      csv += fmt::format(",{}", values_of(record));
      if (moves) csv += motion_values_of(record);
      if (record.balloon_mm > 0) csv += fmt::format(",{:.6g},{:.6g}", record.balloon_bar, record.balloon_mm);
      if (record.free_rings) csv += fmt::format(",{:.6g},{}", record.pose.release_mm, *record.free_rings);
      if (record.coil)
        csv += fmt::format(",{:.6g},{},{:.6g}", record.coil->out_mm, record.coil->detached,
                           record.coil->packing);
    }
    csv += fmt::format(",{:.6g}\n", row.front().aortic_mmHg);
  }
  return csv;
}

}  // namespace xraycast
