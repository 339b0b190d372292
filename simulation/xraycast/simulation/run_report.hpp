#pragma once

#include "xraycast/blood_flow/embolisation.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/simulation/coiling.hpp"

#include <glm/vec3.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// What one instrument did in a run so far (docs/exercises.md).
struct InstrumentFigures {
  double path_mm = 0;          ///< of the tip
  double idle_s = 0;           ///< of the run's time, in which its hub did not move
  double turned_rad = 0;       ///< of the hub, either way
  int turn_backs = 0;          ///< of the hub's rotation, from one way to the other
  int reversals = 0;           ///< from advancing to withdrawing, or back
  double largest_N = 0;        ///< force at the hub, either way
  double mean_N = 0;           ///< over the time in which it was inserted
  double largest_Nm = 0;       ///< torque at the hub, either way
  double mean_Nm = 0;          ///< over the time in which it was inserted
  double largest_wall_N = 0;   ///< sum of its forces on the wall
  double wall_impulse_Ns = 0;  ///< of what of that sum is above RunReport::kWall_N
  int slips = 0;               ///< the tip went ahead or back much faster than the hub
  int whips = 0;               ///< the tip turned aside much faster than the hub
  int exchanges = 0;
};

/// What a run used so far, as its front end counts it. None: it has no means to use any.
struct RunUse {
  std::optional<double> fluoroscopy_s{};
  std::optional<long long> exposures{}, cine_runs{};
  std::optional<double> air_kerma_mGy{};  ///< at the patient entrance reference point
  std::optional<double> dap_Gycm2{};      ///< dose-area product
  std::optional<double> contrast_ml{};
  std::vector<Embolised> embolised{};  ///< by particles in it
  std::vector<double> tips_mmHg{};     ///< see TipPressures::tip_means_mmHg
};

/// What was done to a vessel in a run so far.
struct TreatmentFigures {
  Treatment treatment;   ///< whose times are the instruments'
  std::string vessel{};  ///< the branch in words
  /// Of the run's time; none while it goes on.
  double began_s = 0;
  std::optional<double> ended_s{};
};

struct RunFigures {
  double time_s = 0;  ///< since a hub moved first, or its pressure or sheath, or detached a coil
  double idle_s = 0;  ///< of that, in which no hub moved
  RunUse use;
  std::vector<InstrumentFigures> instruments;  ///< from the outermost on
  std::vector<TreatmentFigures> treatments{};  ///< in the order in which they began
  std::vector<Coiling> coilings{};             ///< as they are; their times are those of the run
};

/// How a run went over its time, for plots: values of each instrument, `RunReport::kSeries_s` apart.
struct RunSeries {
  struct Values {
    std::vector<double> insertion_mm, path_mm;
    std::vector<double> force_N, torque_Nm;  ///< at the hub
    std::vector<double> wall_N;              ///< the largest since the value before
    std::vector<double> mmHg;                ///< see RunUse::tips_mmHg; none where they are not told
  };
  std::vector<double> time_s;
  std::vector<Values> instruments;
};

/// Adds up what a run's instruments do, step by step, so that a page and the program tell the same of the
/// same steps.
class RunReport {
 public:
  /// A tip has moved once it is so far from where it was counted last: it trembles by less.
  static constexpr double kTipMoves_mm = 0.5;
  /// A hub has turned back once it is so far from where it was furthest.
  static constexpr double kTurnsBack_mm = 1, kTurnsBack_rad = 0.1;
  /// Below these speeds a hub is idle.
  static constexpr double kIdle_mm_s = 0.5, kIdle_rad_s = 0.05;
  /// What a wall bears without an impulse being counted.
  static constexpr double kWall_N = 0.1;
  /// A tip slips or whips when, in the mean of so long, it is faster than its hub by so much; it does so once
  /// until it is slower again.
  static constexpr int kWindow_steps = 10;
  static constexpr double kSlip_mm_s = 100, kWhip_rad_s = 10;
  static constexpr double kSeries_s = 0.2;
  static constexpr std::size_t kMostSeries = 18'000;  ///< of an hour; later values are left out

  /// Of instruments before their first step.
  explicit RunReport(const Instruments& instruments);

  /// After each step of the same instruments, with what was used by then.
  void add(const Instruments& instruments, const RunUse& use = {});

  /// What was used in all, where that is known only at the end.
  void use(const RunUse& use) { figures_.use = use; }

  /// Another model took an instrument's place: what it does is added to that place's figures.
  void exchanged(std::size_t instrument, const Instruments& instruments);

  const RunFigures& figures() const { return figures_; }
  const RunSeries& series() const { return series_; }
  bool is_series_cut() const { return is_series_cut_; }  ///< the run is longer than the series
  /// The sum of the forces on the wall of any instrument at the last step, the largest one.
  double wall_N() const { return wall_N_; }

 private:
  /// How far a hub has gone one way.
  struct Course {
    double furthest = 0;  ///< in the direction of its motion
    int direction = 0;    ///< 1 or -1; 0: it has not moved
    /// Whether it has turned back by so much.
    bool turns_back(double now, double least);
  };
  struct Way {
    HubPose before;
    Course insertion, rotation;
    glm::dvec3 counted_mm{0, 0, 0};
    double inserted_s = 0, impulse_Ns = 0, impulse_Nms = 0;  ///< of the loads at the hub, for their means
    /// Where hub and tip were as a window began.
    HubPose window_pose;
    glm::dvec3 window_tip_mm{0, 0, 0}, window_direction{0, 0, 1};
    bool slips = false, whips = false;
    double wall_N = 0;  ///< since the last value of the series
    long idle_steps = 0;
  };
  static Way way_of(const Instruments& instruments, std::size_t instrument);
  static void begin_window(Way& way, const HubPose& pose, const InstrumentTip& tip);
  bool add_hub(std::size_t instrument, const Instruments& instruments);
  void add_loads(std::size_t instrument, const Instruments& instruments);
  void add_treatments(const Instruments& instruments);
  void add_coilings(const Instruments& instruments);
  void add_window(std::size_t instrument, const Instruments& instruments);
  void add_series(const Instruments& instruments);

  RunFigures figures_;
  RunSeries series_;
  std::vector<Way> ways_;
  std::vector<InstrumentContact> contacts_;
  std::vector<double> past_sacs_ml_s_;
  std::vector<bool> moves_;
  double wall_N_ = 0;
  bool is_series_cut_ = false;
  long coil_changes_ = 0;            ///< that were added; see Instruments
  long steps_ = 0, idle_steps_ = 0;  ///< since a hub moved first
};

}  // namespace xraycast
