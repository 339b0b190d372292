#include "xraycast/simulation/run_report.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {

bool RunReport::Course::turns_back(double now, double least) {
  const double ahead = now - furthest;
  if (direction * ahead > 0 || (direction == 0 && std::abs(ahead) >= least)) {
    furthest = now;
    if (direction == 0) direction = ahead > 0 ? 1 : -1;
    return false;
  }
  if (direction == 0 || direction * ahead > -least) return false;
  direction = -direction;
  furthest = now;
  return true;
}

RunReport::Way RunReport::way_of(const Instruments& instruments, std::size_t instrument) {
  Way way;
  const InstrumentTip tip = instruments.tip(instrument);
  way.before = instruments.pose(instrument);
  way.insertion.furthest = way.before.insertion_mm;
  way.rotation.furthest = way.before.rotation_rad;
  way.counted_mm = tip.position_mm;
  begin_window(way, way.before, tip);
  return way;
}

void RunReport::begin_window(Way& way, const HubPose& pose, const InstrumentTip& tip) {
  way.window_pose = pose;
  way.window_tip_mm = tip.position_mm;
  way.window_direction = tip.direction;
}

RunReport::RunReport(const Instruments& instruments)
    : past_sacs_ml_s_(flows_past_sacs(instruments.tree())), moves_(instruments.count()) {
  figures_.instruments.resize(instruments.count());
  series_.instruments.resize(instruments.count());
  for (std::size_t d = 0; d < instruments.count(); ++d) ways_.push_back(way_of(instruments, d));
}

void RunReport::add(const Instruments& instruments, const RunUse& use) {
  figures_.use = use;
  bool moves = false;
  wall_N_ = 0;
  for (std::size_t d = 0; d < instruments.count(); ++d) {
    moves_[d] = add_hub(d, instruments);
    moves = moves || moves_[d];
    add_loads(d, instruments);
  }
  if (!moves && steps_ == 0) {
    for (std::size_t d = 0; d < instruments.count(); ++d)
      begin_window(ways_[d], instruments.pose(d), instruments.tip(d));
    return;
  }
  ++steps_;
  if (!moves) ++idle_steps_;
  const double step_s = instruments.step_s();
  figures_.time_s = static_cast<double>(steps_) * step_s;
  figures_.idle_s = static_cast<double>(idle_steps_) * step_s;
  for (std::size_t d = 0; d < instruments.count(); ++d) {
    if (!moves_[d]) ++ways_[d].idle_steps;
    figures_.instruments[d].idle_s = static_cast<double>(ways_[d].idle_steps) * step_s;
    if (steps_ % kWindow_steps == 0) add_window(d, instruments);
  }
  add_treatments(instruments);
  if (steps_ % kWindow_steps == 0) add_coilings(instruments);
  if (figures_.time_s >= static_cast<double>(series_.time_s.size()) * kSeries_s) add_series(instruments);
}

void RunReport::exchanged(std::size_t instrument, const Instruments& instruments) {
  Way& way = ways_[instrument];
  const Way before = way;
  way = way_of(instruments, instrument);
  way.inserted_s = before.inserted_s;
  way.impulse_Ns = before.impulse_Ns;
  way.impulse_Nms = before.impulse_Nms;
  way.idle_steps = before.idle_steps;
  ++figures_.instruments[instrument].exchanges;
}

/// Whether it moves.
bool RunReport::add_hub(std::size_t instrument, const Instruments& instruments) {
  InstrumentFigures& figures = figures_.instruments[instrument];
  Way& way = ways_[instrument];
  const HubPose& pose = instruments.pose(instrument);
  const double moved_mm = pose.insertion_mm - way.before.insertion_mm,
               turned_rad = pose.rotation_rad - way.before.rotation_rad, step_s = instruments.step_s();
  const bool treats = pose.inflation_bar != way.before.inflation_bar ||
                      pose.release_mm != way.before.release_mm || pose.detach != way.before.detach;
  way.before = pose;
  figures.turned_rad += std::abs(turned_rad);
  if (way.insertion.turns_back(pose.insertion_mm, kTurnsBack_mm)) ++figures.reversals;
  if (way.rotation.turns_back(pose.rotation_rad, kTurnsBack_rad)) ++figures.turn_backs;
  const glm::dvec3 tip_mm = instruments.tip(instrument).position_mm;
  if (const double away_mm = glm::distance(tip_mm, way.counted_mm); away_mm >= kTipMoves_mm) {
    figures.path_mm += away_mm;
    way.counted_mm = tip_mm;
  }
  return std::abs(moved_mm) > kIdle_mm_s * step_s || std::abs(turned_rad) > kIdle_rad_s * step_s || treats;
}

void RunReport::add_loads(std::size_t instrument, const Instruments& instruments) {
  InstrumentFigures& figures = figures_.instruments[instrument];
  Way& way = ways_[instrument];
  const HubLoad load = instruments.load(instrument);
  const double force_N = std::abs(load.force_N), torque_Nm = std::abs(load.torque_Nm),
               step_s = instruments.step_s();
  figures.largest_N = std::max(figures.largest_N, force_N);
  figures.largest_Nm = std::max(figures.largest_Nm, torque_Nm);
  constexpr double kRounding_mm = 1e-6;  // of a hand that rests at the entry
  if (instruments.pose(instrument).insertion_mm > kRounding_mm) {
    way.inserted_s += step_s;
    way.impulse_Ns += force_N * step_s;
    way.impulse_Nms += torque_Nm * step_s;
    figures.mean_N = way.impulse_Ns / way.inserted_s;
    figures.mean_Nm = way.impulse_Nms / way.inserted_s;
  }
  instruments.copy_contacts(instrument, contacts_);
  double wall_N = 0;
  for (const InstrumentContact& contact : contacts_) wall_N += glm::length(contact.force_N);
  figures.largest_wall_N = std::max(figures.largest_wall_N, wall_N);
  figures.wall_impulse_Ns += std::max(0.0, wall_N - kWall_N) * step_s;
  way.wall_N = std::max(way.wall_N, wall_N);
  wall_N_ = std::max(wall_N_, wall_N);
}

void RunReport::add_treatments(const Instruments& instruments) {
  const std::vector<Treatment>& list = instruments.treatments().list();
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (i == figures_.treatments.size())
      figures_.treatments.push_back({.treatment = {}, .began_s = figures_.time_s});
    TreatmentFigures& figures = figures_.treatments[i];
    if (figures.ended_s) continue;
    figures.treatment = list[i];
    figures.vessel = instruments.tree().title(list[i].branch);
    if (list[i].is_over) figures.ended_s = figures_.time_s;
  }
}

/// As they come out, and once more when they are detached.
void RunReport::add_coilings(const Instruments& instruments) {
  if (instruments.coil_changes() == coil_changes_) return;
  coil_changes_ = instruments.coil_changes();
  figures_.coilings = coilings_of(instruments, past_sacs_ml_s_);
  const double ahead_s = instruments.time_s() - figures_.time_s;
  for (Coiling& coiling : figures_.coilings) {
    coiling.from_s = std::max(0.0, coiling.from_s - ahead_s);
    coiling.to_s = std::max(0.0, coiling.to_s - ahead_s);
  }
}

void RunReport::add_window(std::size_t instrument, const Instruments& instruments) {
  InstrumentFigures& figures = figures_.instruments[instrument];
  Way& way = ways_[instrument];
  const HubPose& pose = instruments.pose(instrument);
  const InstrumentTip tip = instruments.tip(instrument);
  const double window_s = kWindow_steps * instruments.step_s();
  const double advanced_mm = std::abs(pose.insertion_mm - way.window_pose.insertion_mm),
               turned_rad = std::abs(pose.rotation_rad - way.window_pose.rotation_rad);
  const double slid_mm = std::abs(glm::dot(tip.position_mm - way.window_tip_mm, way.window_direction));
  const double bent_rad = std::acos(std::clamp(glm::dot(tip.direction, way.window_direction), -1.0, 1.0));
  const bool slips = (slid_mm - advanced_mm) / window_s > kSlip_mm_s;
  const bool whips = (bent_rad - turned_rad) / window_s > kWhip_rad_s;
  if (slips && !way.slips) ++figures.slips;
  if (whips && !way.whips) ++figures.whips;
  way.slips = slips;
  way.whips = whips;
  begin_window(way, pose, tip);
}

void RunReport::add_series(const Instruments& instruments) {
  if (series_.time_s.size() >= kMostSeries) {
    is_series_cut_ = true;
    return;
  }
  series_.time_s.push_back(figures_.time_s);
  for (std::size_t d = 0; d < instruments.count(); ++d) {
    RunSeries::Values& values = series_.instruments[d];
    const HubLoad load = instruments.load(d);
    values.insertion_mm.push_back(instruments.pose(d).insertion_mm);
    values.path_mm.push_back(figures_.instruments[d].path_mm);
    values.force_N.push_back(load.force_N);
    values.torque_Nm.push_back(load.torque_Nm);
    values.wall_N.push_back(ways_[d].wall_N);
    ways_[d].wall_N = 0;
    // Before a heartbeat was seen values are as its mean.
    if (d < figures_.use.tips_mmHg.size())
      values.mmHg.resize(series_.time_s.size(), figures_.use.tips_mmHg[d]);
  }
}

}  // namespace xraycast
