#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/blood_flow/blood.hpp"
#include "xraycast/coaxial/instruments.hpp"
#include "xraycast/contrast_agent/injection.hpp"
#include "xraycast/motion/body_request.hpp"
#include "xraycast/simulation/coiling.hpp"
#include "xraycast/simulation/instrument_pressures.hpp"
#include "xraycast/simulation/run_report.hpp"
#include "xraycast/simulation/script.hpp"

#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace xraycast {

/// Presets by their names, or JSON files. Throws InputError.
std::vector<InstrumentModel> instruments_named(const std::vector<std::string>& names);

/// Instruments in a vessel tree, and what moves their hubs: a script, or a hand (see HapticDevice).
struct RunRequest {
  std::shared_ptr<const VesselTree> tree{};
  /// One to Instruments::kMaxCount, from the outermost on, one in the other.
  std::vector<InstrumentModel> instruments = instruments_named({"cobra-5f"});
  EntryChoice entry{};
  std::optional<Script> script{};  ///< none: a hand moves the hubs
  Injection injection{};           ///< of contrast agent
  Blood blood{};                   ///< that flows about the instruments
  double interval_s = 0;           ///< between records; 0: they are of the script's rows
  /// How the body moves about the instruments. At 0 s of the script it is 0 s, until then it is held. Its
  /// gate is for exposures.
  BodyRequest body{};
};

/// Throws InputError for what cannot be run: no tree, instruments that do not fit into each other or into the
/// vessel at their entry, a script that inserts one beyond its length or inflates what is no balloon or one
/// beyond its rated burst pressure, draws back a sheath that is none or beyond its stent, a stent longer than
/// any vessel, detachments of what has no coils, coils where the tree has no aneurysm or none that is large
/// enough, an injection through no lumen or after the script's end, and a body that cannot be (see check
/// of BodyRequest). Returns notes: where the entry was not chosen, other ends that lie as low; an entry that
/// the motion moves away from the introducer.
std::vector<std::string> check(const RunRequest& request);

/// How instruments are put in for a run.
Instruments::Options instrument_options(const RunRequest& request);

/// Where the outermost instrument enters. Throws as find_entry.
VesselEnd entry_of(const RunRequest& request);

/// `right external iliac artery at (-89.0, -54.0, -357.0) mm, on the patient's right`; `branch 3 at ...` of a
/// vessel without a name.
std::string text_of(const VesselTree& tree, const VesselEnd& end);

/// `balloon-6x20 in left renal artery: 6 mm at 8 bar; least diameter 2.51 mm before, 5.90 mm after, of 5.98
/// mm: residual stenosis 1 %`.
std::string in_words(const Treatment& treatment, const VesselTree& tree);

/// An instrument's state in a run.
struct RunRecord {
  static constexpr double kNoPressure = std::numeric_limits<double>::quiet_NaN();
  double time_s = 0;
  HubPose pose;
  HubLoad load;
  InstrumentTip tip;
  int contacts = 0;                 ///< contact points in contact with a wall
  double contact_force_N = 0;       ///< sum of the magnitudes of their forces
  double deepest_mm = 0;            ///< depth in the wall
  double wall_work_J = 0;           ///< of the moving wall on the instrument so far
  double balloon_bar = 0;           ///< as far as it is filled; see Instruments::balloon_bar
  double balloon_mm = 0;            ///< diameter of its balloon; 0 without one
  std::optional<int> free_rings{};  ///< of the stent in its sheath, those that left it; none without a sheath
  /// Of a wire that pushes coils; none of another instrument.
  struct Coil {
    double out_mm = 0;   ///< of the coil on it, in the sac
    int detached = 0;    ///< so far
    double packing = 0;  ///< of the sac that the coil is in, or the last one; 0: of none
  };
  std::optional<Coil> coil{};
  double pressure_mmHg = kNoPressure,
         aortic_mmHg = kNoPressure;  ///< of the blood at the tip; without any no number
  std::vector<double> phases{};      ///< of the motion's modes; none without a motion
};

/// Of a wire that pushes coils; none of another instrument.
std::optional<RunRecord::Coil> coil_of(const Instruments& instruments, std::size_t instrument);

/// A record of each instrument, from the outermost on; its pressures where there is blood.
std::vector<RunRecord> records_of(const Instruments& instruments, double time_s,
                                  const InstrumentPressures* blood = nullptr);

/// The pressures of the blood over a run, as a pressure line would show them.
struct PressureSample {
  double time_s = 0, aortic_mmHg = 0;
  std::vector<double> tips_mmHg;  ///< of each instrument
};

/// What a run leads to.
struct Run {
  VesselEnd entry;
  std::vector<std::vector<RunRecord>> records;  ///< in the order of time, of each instrument
  std::vector<RunRecord> last;                  ///< of each instrument, at the time since it began to move
  double held_s = 0;                            ///< for so long a hub did not advance, because of the force
  double not_inflated_s = 0;                    ///< for so long a balloon stayed folded, not being free
  double not_released_s = 0;                    ///< likewise a stent in a sheath that was drawn back
  std::vector<std::string> notes{};             ///< on the run, besides those of check()
  std::vector<std::string> modes{};             ///< of its motion, in the order of a record's phases
  std::vector<Treatment> treatments{};          ///< by balloons and stents
  std::vector<Coiling> coilings{};              ///< by coils, as at the end
  std::vector<Embolised> embolised{};           ///< by particles, as at the end
  double injected_ml = 0, withheld_ml = 0;      ///< of the injection; see InjectedVolume
  std::vector<PressureSample> pressures{};  ///< a hundred a second, fewer in runs longer than kPressures_s
  static constexpr double kPressures_s = 300;
};

/// Is told of the instruments and of the blood about them at 0 s, where the hubs are at the script's first
/// poses, and after each step.
using RunListener =
    std::function<void(const Instruments& instruments, double time_s, const InstrumentPressures& blood)>;

/// What a front end counts of a run by itself, with what the blood tells: the agent that was injected, where
/// the request has an injection, and the pressures at the tips.
RunUse with_blood(RunUse use, const RunRequest& request, const InstrumentPressures& blood);

/// Runs a script as fast as the machine can. Beforehand the hubs are moved to its first poses, unrecorded.
/// Deterministic: bit for bit the same on one machine. Throws InputError as check() does, and for first poses
/// that an instrument does not reach; and Cancelled.
Run run(const RunRequest& request, Progress& progress, const RunListener& listener = {});

/// CSV: a header with the columns' names and units, then a line per record; a group of columns an instrument:
/// insertion_mm, insertion_2_mm and so on. Of a motion, the modes' phases follow the time, phase_heart and so
/// on, and each group ends with the tip's place in the scan and the wall's work. An instrument with a balloon
/// ends with inflation_bar and balloon_mm, one with a stent in a sheath with release_mm and free_rings,
/// a wire that pushes coils with coil_mm, detached and packing.
/// The last column is the aorta's pressure.
std::string to_csv(const Run& run);

}  // namespace xraycast
