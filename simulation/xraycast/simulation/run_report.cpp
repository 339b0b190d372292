#include "xraycast/simulation/run_report.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {

RunReport::Way RunReport::way_of(const Instruments& instruments, std::size_t instrument) {
  Way way;
  way.before = instruments.pose(instrument);
  way.furthest_mm = way.before.insertion_mm;
  way.counted_mm = instruments.tip(instrument).position_mm;
  return way;
}

RunReport::RunReport(const Instruments& instruments) {
  figures_.instruments.resize(instruments.count());
  for (std::size_t d = 0; d < instruments.count(); ++d) ways_.push_back(way_of(instruments, d));
}

void RunReport::add(const Instruments& instruments) {
  bool moves = false;
  for (std::size_t d = 0; d < instruments.count(); ++d) {
    if (add_hub(d, instruments)) moves = true;
    add_loads(d, instruments);
  }
  if (!moves && figures_.time_s == 0) return;
  figures_.time_s += instruments.step_s();
  if (!moves) figures_.idle_s += instruments.step_s();
}

void RunReport::exchanged(std::size_t instrument, const Instruments& instruments) {
  Way& way = ways_[instrument];
  const double inserted_s = way.inserted_s, impulse_Ns = way.impulse_Ns;
  way = way_of(instruments, instrument);
  way.inserted_s = inserted_s;
  way.impulse_Ns = impulse_Ns;
  ++figures_.instruments[instrument].exchanges;
}

/// Whether it moves.
bool RunReport::add_hub(std::size_t instrument, const Instruments& instruments) {
  InstrumentFigures& figures = figures_.instruments[instrument];
  Way& way = ways_[instrument];
  const HubPose& pose = instruments.pose(instrument);
  const double moved_mm = pose.insertion_mm - way.before.insertion_mm,
               turned_rad = pose.rotation_rad - way.before.rotation_rad, step_s = instruments.step_s();
  way.before = pose;
  figures.turned_rad += std::abs(turned_rad);
  const double ahead_mm = pose.insertion_mm - way.furthest_mm;
  if (way.direction * ahead_mm > 0 || (way.direction == 0 && std::abs(ahead_mm) >= kTurnsBack_mm)) {
    way.furthest_mm = pose.insertion_mm;
    if (way.direction == 0) way.direction = ahead_mm > 0 ? 1 : -1;
  } else if (way.direction * ahead_mm <= -kTurnsBack_mm) {
    way.direction = -way.direction;
    way.furthest_mm = pose.insertion_mm;
    ++figures.reversals;
  }
  const glm::dvec3 tip_mm = instruments.tip(instrument).position_mm;
  if (const double away_mm = glm::distance(tip_mm, way.counted_mm); away_mm >= kTipMoves_mm) {
    figures.path_mm += away_mm;
    way.counted_mm = tip_mm;
  }
  return std::abs(moved_mm) > kIdle_mm_s * step_s || std::abs(turned_rad) > kIdle_rad_s * step_s;
}

void RunReport::add_loads(std::size_t instrument, const Instruments& instruments) {
  InstrumentFigures& figures = figures_.instruments[instrument];
  Way& way = ways_[instrument];
  const HubLoad load = instruments.load(instrument);
  const double force_N = std::abs(load.force_N), step_s = instruments.step_s();
  figures.largest_N = std::max(figures.largest_N, force_N);
  figures.largest_Nm = std::max(figures.largest_Nm, std::abs(load.torque_Nm));
  if (instruments.pose(instrument).insertion_mm > 0) {
    way.inserted_s += step_s;
    way.impulse_Ns += force_N * step_s;
    figures.mean_N = way.impulse_Ns / way.inserted_s;
  }
  instruments.copy_contacts(instrument, contacts_);
  double wall_N = 0;
  for (const InstrumentContact& contact : contacts_) wall_N += glm::length(contact.force_N);
  figures.largest_wall_N = std::max(figures.largest_wall_N, wall_N);
  figures.wall_impulse_Ns += std::max(0.0, wall_N - kWall_N) * step_s;
}

}  // namespace xraycast
