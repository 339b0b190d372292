#pragma once

#include "xraycast/coaxial/instruments.hpp"

#include <glm/vec3.hpp>

#include <cstddef>
#include <vector>

namespace xraycast {

/// What one instrument did in a run so far (docs/web.md).
struct InstrumentFigures {
  double path_mm = 0;          ///< of the tip
  double turned_rad = 0;       ///< of the hub, either way
  int reversals = 0;           ///< from advancing to withdrawing, or back
  double largest_N = 0;        ///< force at the hub, either way
  double mean_N = 0;           ///< over the time in which it was inserted
  double largest_Nm = 0;       ///< torque at the hub, either way
  double largest_wall_N = 0;   ///< sum of its forces on the wall
  double wall_impulse_Ns = 0;  ///< of what of that sum is above RunReport::kWall_N
  int exchanges = 0;
};

struct RunFigures {
  double time_s = 0;                           ///< since a hub moved first
  double idle_s = 0;                           ///< of that, in which no hub moved
  std::vector<InstrumentFigures> instruments;  ///< from the outermost on
};

/// Adds up what a run's instruments do, step by step, so that a page and the program tell the same of the
/// same steps.
class RunReport {
 public:
  /// A tip has moved once it is so far from where it was counted last: it trembles by less.
  static constexpr double kTipMoves_mm = 0.5;
  /// A hub has turned back once it is so far from where it was furthest.
  static constexpr double kTurnsBack_mm = 1;
  /// Below these speeds a hub is idle.
  static constexpr double kIdle_mm_s = 0.5, kIdle_rad_s = 0.05;
  /// What a wall bears without an impulse being counted.
  static constexpr double kWall_N = 0.1;

  /// Of instruments before their first step.
  explicit RunReport(const Instruments& instruments);

  /// After each step of the same instruments.
  void add(const Instruments& instruments);

  /// Another model took an instrument's place: what it does is added to that place's figures.
  void exchanged(std::size_t instrument, const Instruments& instruments);

  const RunFigures& figures() const { return figures_; }

 private:
  struct Way {
    HubPose before;
    double furthest_mm = 0;  ///< in the direction of its motion
    int direction = 0;       ///< 1: it advances, -1: it is withdrawn
    glm::dvec3 counted_mm{0, 0, 0};
    double inserted_s = 0, impulse_Ns = 0;  ///< of the force at the hub, for its mean
  };
  static Way way_of(const Instruments& instruments, std::size_t instrument);
  bool add_hub(std::size_t instrument, const Instruments& instruments);
  void add_loads(std::size_t instrument, const Instruments& instruments);

  RunFigures figures_;
  std::vector<Way> ways_;
  std::vector<InstrumentContact> contacts_;
};

}  // namespace xraycast
