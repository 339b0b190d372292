#include "motion.hpp"

#include "calls/arguments.hpp"
#include "calls/job.hpp"
#include "calls/values.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/motion/moved_scan.hpp"

#include <map>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <utility>

namespace xraycast::python {
namespace {

std::map<std::string, double> phases_of(const nb::object& phase) {
  std::map<std::string, double> phases;
  if (phase.is_none()) return phases;
  if (!nb::isinstance<nb::dict>(phase))
    throw InputError("phase: must be a dict of modes and their phases, such as {{'breath': 0.3}}");
  for (const auto& [mode, value] : nb::borrow<nb::dict>(phase)) {
    if (!nb::isinstance<nb::str>(mode)) throw InputError("phase: its keys must be names of modes");
    const auto name = nb::cast<std::string>(mode);
    phases[name] = number_of(value, "phase " + name);
  }
  return phases;
}

HeldMotion held_at(const Motion& motion, const nb::object& phase, const nb::object& time) {
  if (phase.is_none() == time.is_none()) throw InputError("phase and time: give one of them");
  return motion.held_at(time.is_none() ? motion.phases_of(phases_of(phase))
                                       : motion.phases_at(number_of(time, "time")));
}

using PointArray = nb::ndarray<nb::numpy, double, nb::shape<-1, 3>>;

PointArray array_of(std::vector<glm::dvec3> points) {
  const auto held = std::make_shared<std::vector<glm::dvec3>>(std::move(points));
  return PointArray(array_over<double, 2>(&held->data()->x, {held->size(), 3}, held));
}

nb::typed<nb::dict, nb::str, float> phases_at(const Motion& motion, double time) {
  const std::vector<double> phases = motion.phases_at(time);
  nb::dict named;
  for (std::size_t m = 0; m < phases.size(); ++m) named[text_object(motion.modes()[m].name)] = phases[m];
  return nb::borrow<nb::typed<nb::dict, nb::str, float>>(named);
}

PointArray displacement(const Motion& motion, const ArrayArgument& points, const PhaseArgument& phase,
                        const TimeArgument& time) {
  const HeldMotion held = held_at(motion, phase, time);
  std::vector<glm::dvec3> places = points_of(points, "points"), moved = places;
  held.displace(moved);
  for (std::size_t i = 0; i < places.size(); ++i) moved[i] -= places[i];
  return array_of(std::move(moved));
}

PointArray inverse(const Motion& motion, const ArrayArgument& points, const PhaseArgument& phase,
                   const TimeArgument& time) {
  const HeldMotion held = held_at(motion, phase, time);
  std::vector<glm::dvec3> places = points_of(points, "points");
  for (glm::dvec3& place : places) {
    const InverseResult found = held.inverse_mm(place);
    place = found.is_found ? found.x_mm : glm::dvec3(std::numeric_limits<double>::quiet_NaN());
  }
  return array_of(std::move(places));
}

HeldScan moved(HeldScan& scan, const PathArgument& motion, const PhaseArgument& phase,
               const TimeArgument& time, const ProgressArgument& progress) {
  const MotionRequest request = motion_request_of(motion, phase, time);
  HeldScan moved =
      result_of(progress, [&](Progress& reported) { return moved_scan(scan, request, reported); });
  warn(moved.info().warnings);
  return moved;
}

}  // namespace

MotionRequest motion_request_of(const nb::object& motion, const nb::object& phase, const nb::object& time) {
  MotionRequest request;
  if (!motion.is_none()) request.motion = path_of(motion);
  request.phase = phases_of(phase);
  if (!time.is_none()) request.time_s = number_of(time, "time");
  check(request);
  return request;
}

MotionOfRun motion_of_run(const nb::object& motion, const nb::object& phase) {
  MotionOfRun of_run{nullptr, phases_of(phase)};
  if (motion.is_none()) return of_run;
  const std::string file = path_of(motion);
  of_run.motion =
      result_of(nb::none(), [&](Progress&) { return std::make_shared<const Motion>(read_motion(file)); });
  return of_run;
}

HeldScan moved_scan(const HeldScan& scan, const MotionRequest& request, Progress& progress) {
  const MotionOfRequest motion = held_motion(request);
  ScanInfo info = scan.info();
  info.warnings = motion.warnings;
  const std::string source = scan.source() + motion.suffix();
  if (!motion.held.is_still())
    for (std::string& warning : check_motion(*scan.volume(), motion.held, motion.name))
      info.warnings.push_back(std::move(warning));
  const auto slices = moved_slices(scan.volume(), motion.held, scan.hu_range());
  HeldScan held(collect(*slices, progress, source), std::move(info), source);
  held.set_hu_range(scan.hu_range());
  return held;
}

void add_motion(nb::module_& module, nb::class_<HeldScan>& scan) {
  nb::class_<Motion>(module, "Motion",
                     "How a body moves: modes such as breath and heart, from a motion.json.")
      .def_static(
          "read",
          [](const PathArgument& path) {
            const std::string file = path_of(path);
            return result_of(nb::none(), [&](Progress&) { return read_motion(file); });
          },
          nb::arg("path"), "Reads a motion.json and its fields.")
      .def_prop_ro(
          "modes",
          [](const Motion& m) {
            std::vector<std::string> names;
            for (const MotionMode& mode : m.modes()) names.push_back(mode.name);
            return text_objects(names);
          },
          "The names of its modes.")
      .def_prop_ro(
          "warnings", [](const Motion& m) { return text_objects(m.warnings()); },
          "Where its displacements fold.")
      .def("phases", phases_at, nb::arg("time"), "The phase of each mode at a time in seconds.")
      .def(
          "displacement", displacement, nb::arg("points"), nb::kw_only(), nb::arg("phase") = nb::none(),
          nb::arg("time") = nb::none(),
          "d of (n, 3) places x in mm, LPS: x shows what lies at x + d in the scan.\n\n"
          "phase: a dict of modes and their phases, 0 to 1; the others are at 0.  time: instead, in seconds.")
      .def(
          "inverse", inverse, nb::arg("points"), nb::kw_only(), nb::arg("phase") = nb::none(),
          nb::arg("time") = nb::none(),
          "Where (n, 3) places of the scan are in the moved body, mm, LPS, within 0.05 mm; NaN where none is "
          "found.\n\nphase, time: as in displacement.")
      .def("__repr__", [](const Motion& m) {
        return text_object(fmt::format("<xraycast.Motion of {}: {} modes>", m.name(), m.modes().size()));
      });
  scan.def("moved", moved, nb::arg("motion"), nb::kw_only(), nb::arg("phase") = nb::none(),
           nb::arg("time") = nb::none(), nb::arg("progress") = nb::none(),
           "The scan at an instant of its motion, on the same grid.\n\n"
           "motion: a motion.json.  phase: a dict of modes and their phases, 0 to 1; the others are at 0.\n"
           "time: instead, in seconds.");
}

}  // namespace xraycast::python
