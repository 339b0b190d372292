#include "flow.hpp"

#include "calls/arguments.hpp"
#include "calls/blood.hpp"
#include "calls/job.hpp"
#include "calls/values.hpp"
#include "vessels.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/blood_flow/flow_cycle.hpp"

#include <cstddef>
#include <memory>
#include <vector>

namespace xraycast::python {
namespace {

struct HeldFlow {
  std::shared_ptr<const VesselTree> tree;
  std::shared_ptr<const FlowCycle> cycle;
};

HeldFlow flow_of(const HeldTree& tree, const nb::object& heart_rate_bpm, const nb::object& heart_waveform,
                 bool hyperaemia, const nb::object& progress) {
  FlowRequest request{tree.tree, blood_of(heart_rate_bpm, heart_waveform)};
  if (hyperaemia) request.blood.coronary_resistance = kHyperaemia;
  check(request);
  return result_of(progress, [&](Progress& reported) {
    return HeldFlow{tree.tree, std::make_shared<const FlowCycle>(flow_cycle(request, reported))};
  });
}

/// (samples, branches).
auto samples_of(const HeldFlow& held, std::vector<double> FlowCycle::Vessel::*values) {
  const std::size_t samples = held.cycle->time_s.size();
  const auto all = std::make_shared<std::vector<double>>();
  for (std::size_t i = 0; i < samples; ++i)
    for (const FlowCycle::Vessel& vessel : held.cycle->vessels) all->push_back((vessel.*values)[i]);
  return array_over<double, 2>(all->data(), {samples, held.cycle->vessels.size()}, all);
}

auto line_of(const HeldFlow& held, std::vector<double> FlowCycle::*values) {
  const std::vector<double>& line = *held.cycle.*values;
  return array_over<const double, 1>(line.data(), {line.size()}, held.cycle);
}

auto ratios_of(const HeldFlow& held) {
  const auto all = std::make_shared<std::vector<double>>();
  for (std::size_t b = 0; b < held.cycle->vessels.size(); ++b) all->push_back(held.cycle->pressure_ratio(b));
  return array_over<double, 1>(all->data(), {all->size()}, all);
}

}  // namespace

void add_flow(nb::module_& module) {
  nb::class_<HeldFlow>(module, "BloodFlow", "What flow() gives: pressures and flows over a heartbeat.")
      .def_prop_ro(
          "time_s", [](const HeldFlow& f) { return line_of(f, &FlowCycle::time_s); }, kShared,
          "Of the samples, (samples,) float64, since the heart began to eject, or its waveform.")
      .def_prop_ro(
          "aortic_mmHg", [](const HeldFlow& f) { return line_of(f, &FlowCycle::aortic_mmHg); }, kShared,
          "The pressure before the root, (samples,) float64.")
      .def_prop_ro(
          "flow_ml_s", [](const HeldFlow& f) { return samples_of(f, &FlowCycle::Vessel::ml_s); }, kShared,
          "Through the start of each branch, away from the root, (samples, branches) float64.")
      .def_prop_ro(
          "pressure_mmHg", [](const HeldFlow& f) { return samples_of(f, &FlowCycle::Vessel::mmHg); }, kShared,
          "At the end of each branch, (samples, branches) float64.")
      .def_prop_ro(
          "pressure_ratio", ratios_of, kShared,
          "The mean pressure at each branch's end over the aorta's, (branches,) float64; at hyperaemia the "
          "fractional flow reserve.")
      .def_prop_ro(
          "notes", [](const HeldFlow& f) { return text_objects(f.cycle->notes); },
          "On a root that is no place where blood enters a body, a line each.")
      .def(
          "write",
          [](const HeldFlow& f, const PathArgument& path) {
            write_whole_file(path_of(path), to_csv(*f.cycle, *f.tree));
          },
          nb::arg("path"), "Writes a table as CSV, as `xraycast flow` does.")
      .def("__repr__", [](const HeldFlow& f) {
        return text_object(fmt::format("<xraycast.BloodFlow of {} branches>", f.cycle->vessels.size()));
      });
  module.def(
      "flow", flow_of, nb::arg("tree"), nb::kw_only(), nb::arg("heart_rate_bpm") = nb::none(),
      nb::arg("heart_waveform") = nb::none(), nb::arg("hyperaemia") = false, nb::arg("progress") = nb::none(),
      nb::sig("def flow(tree: VesselTree, *, heart_rate_bpm: float | None = None, "
              "heart_waveform: str | os.PathLike[str] | numpy.typing.ArrayLike | None = None, "
              "hyperaemia: bool = False, "
              "progress: xraycast._progress.Listener | None = None) -> BloodFlow"),
      "How the blood flows through a VesselTree over a heartbeat (docs/blood-flow.md), as a BloodFlow.\n\n"
      "heart_rate_bpm: beats per minute (None: 70); 0: it flows steadily.  heart_waveform: instead, what the "
      "heart ejects into the aorta over a beat, a CSV file or an array (samples, 2) of times in s and flows "
      "in "
      "ml/s; its mean is the heart's output.  hyperaemia: the coronary periphery has the "
      "least resistance, as by adenosine.");
}

}  // namespace xraycast::python
