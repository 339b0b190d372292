#pragma once

#include "xraycast/scene/session_file.hpp"
#include "xraycast/simulation/run.hpp"

#include <glm/vec3.hpp>

#include <string>
#include <vector>

namespace xraycast {

/// A run of coaxial instruments, or of one alone, as pictures need it: shapes and the hubs' loads, a picture
/// at a time.
struct RecordedRun {
  static constexpr double kUsualStep_s = 1.0 / 15;  ///< of fluoroscopy
  static constexpr double kLongest_s = 600;

  /// The control points of a curve at every picture, from the introducer's side to that of the tip (see
  /// curve_through); none where it is shorter than a curve takes.
  using Shapes = std::vector<std::vector<glm::dvec3>>;

  struct Instrument {
    std::string name;
    SteeredInstruments::Instrument look{};  ///< without nodes
    std::vector<Shapes> parts{};            ///< one for each of instrument_parts
    std::vector<HubLoad> loads{};
  };

  double step_s = kUsualStep_s;
  std::vector<Instrument> instruments{};  ///< from the outermost on
  bool moves = false;                     ///< in a body that did, by the run's time

  /// Of instruments that have yet to move.
  static RecordedRun of(const std::vector<InstrumentModel>& models);

  std::size_t pictures() const { return instruments.empty() ? 0 : instruments.front().loads.size(); }

  /// Takes a picture when its time has come, the first at 0 s. Tell it of a run (see RunListener).
  void record(const Instruments& moved, double time_s);
};

/// Throws InputError for a script longer than RecordedRun::kLongest_s.
void check_recordable(const Script& script);

/// A run, as it is recorded. Throws as run() and check_recordable() do.
RecordedRun recorded_run(const RunRequest& request, Progress& progress);

/// Shapes, ready to be deflated (see PackedNumbers): of every picture the number of points and these,
/// from the tip on, in units, as differences from the same point of the picture before, or else from the
/// point before.
std::string pack_shapes(const RecordedRun::Shapes& shapes_mm, double unit_mm);

}  // namespace xraycast
