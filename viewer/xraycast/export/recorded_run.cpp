#include "xraycast/export/recorded_run.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/export/packed_numbers.hpp"
#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/instrument_curve.hpp"

#include <array>
#include <cmath>
#include <utility>

namespace xraycast {

RecordedRun RecordedRun::of(const std::vector<InstrumentModel>& models) {
  RecordedRun run;
  for (const InstrumentModel& model : models) {
    SteeredInstruments::Instrument look = drawn(model);
    const std::size_t parts = instrument_parts(look).size();
    run.instruments.push_back(
        {.name = model.name(), .look = std::move(look), .parts = std::vector<Shapes>(parts)});
  }
  return run;
}

void RecordedRun::record(const Instruments& moved, double time_s) {
  constexpr double kRounding_s = 1e-9;
  if (time_s < static_cast<double>(pictures()) * step_s - kRounding_s) return;
  moves = !moved.phases().empty();
  std::vector<glm::dvec3> nodes_mm;
  for (std::size_t d = 0; d < instruments.size(); ++d) {
    Instrument& instrument = instruments[d];
    moved.copy_nodes(d, nodes_mm);
    const std::vector<std::vector<glm::dvec3>> lengths_mm = lengths_of(nodes_mm, instrument.look.markers);
    for (std::size_t p = 0; p < lengths_mm.size(); ++p)
      instrument.parts[p].push_back(controls_of(lengths_mm[p]));
    instrument.loads.push_back(moved.load(d));
  }
}

void check_recordable(const Script& script) {
  if (const double end_s = script.rows().back().time_s; end_s > RecordedRun::kLongest_s)
    throw InputError("{}: lasts {:g} s, but an export holds a run of at most {:g} s; shorten it",
                     script.origin(), end_s, RecordedRun::kLongest_s);
}

RecordedRun recorded_run(const RunRequest& request, Progress& progress) {
  if (request.script) check_recordable(*request.script);
  RecordedRun recorded = RecordedRun::of(request.instruments);
  run(request, progress, [&](const Instruments& moved, double time_s, const InstrumentPressures&) {
    recorded.record(moved, time_s);
  });
  return recorded;
}

std::string pack_shapes(const RecordedRun::Shapes& shapes_mm, double unit_mm) {
  using Steps = std::array<std::int64_t, 3>;
  PackedNumbers packed;
  std::vector<Steps> before;
  for (const std::vector<glm::dvec3>& controls_mm : shapes_mm) {
    std::vector<Steps> steps;
    for (auto point = controls_mm.rbegin(); point != controls_mm.rend(); ++point)
      steps.push_back({std::llround(point->x / unit_mm), std::llround(point->y / unit_mm),
                       std::llround(point->z / unit_mm)});
    packed.add(static_cast<std::int64_t>(steps.size()));
    for (std::size_t i = 0; i < steps.size(); ++i) {
      const Steps from = i < before.size() ? before[i] : i > 0 ? steps[i - 1] : Steps{};
      for (std::size_t axis = 0; axis < 3; ++axis) packed.add(steps[i][axis] - from[axis]);
    }
    before = std::move(steps);
  }
  return packed.bytes();
}

}  // namespace xraycast
