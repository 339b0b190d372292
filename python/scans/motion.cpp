#include "scans/motion.hpp"

#include "calls/arguments.hpp"
#include "calls/job.hpp"
#include "calls/values.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/casting/key_maps.hpp"
#include "xraycast/motion/moved_scan.hpp"
#include "xraycast/phase_registration/motion_registration.hpp"
#include "xraycast/reports/registration_report.hpp"

#include <cmath>
#include <filesystem>
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

/// Scans and paths, in their order.
std::vector<PhaseOfScan> phases_of_scans(const nb::object& phases) {
  if (!nb::isinstance<nb::sequence>(phases) || nb::isinstance<nb::str>(phases))
    throw InputError("phases: must be a list of scans or their paths");
  std::vector<PhaseOfScan> opened;
  for (const nb::handle phase : nb::borrow<nb::sequence>(phases)) {
    if (const HeldScan* scan = nullptr; nb::try_cast(phase, scan) && scan)
      opened.push_back({scan->source(),
                        [volume = scan->volume(), frame = frame_of_reference_uid(scan->info())](Progress&) {
                          return RegisteredScan{volume, frame};
                        }});
    else
      opened.push_back(phase_of_file(path_of(phase)));
  }
  return opened;
}

nb::list entries_of(const RegisteredMotion& motion) {
  nb::list entries;
  for (const PhaseRegistration& phase : motion.phases) {
    nb::dict entry;
    entry["scan"] = text_object(phase.name);
    entry["phase"] = phase.phase;
    entry["longest_mm"] = phase.longest_mm;
    entry["before_hu"] = phase.before_hu;
    entry["after_hu"] = phase.after_hu;
    if (phase.landmarks) {
      entry["landmarks_before_mm"] = phase.landmarks->before_mm;
      entry["landmarks_after_mm"] = phase.landmarks->after_mm;
    }
    entries.append(entry);
  }
  return entries;
}

nb::list register_scans(const HeldScan& scan, nb::handle phases, nb::handle folder,
                        const MotionRegistrationRequest& request, const nb::object& progress) {
  const std::vector<PhaseOfScan> opened = phases_of_scans(nb::borrow(phases));
  const std::filesystem::path path = path_of(folder);
  check(request, opened.size());
  const RegisteredScan reference{scan.volume(), frame_of_reference_uid(scan.info())};
  const RegisteredMotion motion = result_of(progress, [&](Progress& reported) {
    RegisteredMotion found = register_phases(reference, scan.source(), opened, request, reported);
    write_registration(found, scan.source(), path, reported);
    return found;
  });
  warn(motion.warnings);
  return entries_of(motion);
}

}  // namespace

MotionRequest motion_request_of(const nb::object& motion, const nb::object& phase, const nb::object& time,
                                bool takes_all) {
  MotionRequest request;
  if (!motion.is_none()) request.motion = path_of(motion);
  request.phase = phases_of(phase);
  if (!time.is_none()) request.time_s = number_of(time, "time");
  if (!takes_all || !request.is_of_all_instants()) check(request);
  return request;
}

std::map<std::string, int> keys_of(const nb::object& keys) {
  std::map<std::string, int> counts;
  if (keys.is_none()) return counts;
  if (!nb::isinstance<nb::dict>(keys))
    throw InputError(
        "keys: must be a dict of modes and numbers of their key phases, such as {{'breath': 4}}");
  for (const auto& [mode, value] : nb::borrow<nb::dict>(keys)) {
    if (!nb::isinstance<nb::str>(mode)) throw InputError("keys: its keys must be names of modes");
    const auto name = nb::cast<std::string>(mode);
    const double count = number_of(value, "keys " + name);
    if (count != std::floor(count) || !(std::abs(count) < 1e6))
      throw InputError("keys {}: must be a whole number", excerpt(name));
    counts[name] = static_cast<int>(count);
  }
  return counts;
}

std::vector<double> phases_at_instant(const BodyMap& map, const nb::object& phase, const nb::object& time) {
  const MotionRequest request{"map", phases_of(phase),
                              time.is_none() ? std::nullopt : std::optional(number_of(time, "time"))};
  if (!request.is_of_all_instants()) check(request);
  if (map.keys) return phases_of(map.keys->phases().rhythm(), request);
  if (!phase.is_none() || !time.is_none())
    throw InputError(
        "phase and time: the map stands still; cast one that moves, with motion and neither of them");
  return {};
}

BodyRequest body_request_of(const nb::object& motion, const nb::object& phase) {
  BodyRequest request{.phase = phases_of(phase)};
  if (motion.is_none()) return request;
  const std::string file = path_of(motion);
  request.motion =
      result_of(nb::none(), [&](Progress&) { return std::make_shared<const Motion>(read_motion(file)); });
  return request;
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
  scan.def(
      "register_phases",
      [](const HeldScan& self, nb::handle phases, nb::handle folder, const std::string& mode, double period_s,
         std::vector<double> at, double grid_mm, double spacing_mm, const nb::object& landmarks,
         const nb::object& mask, const nb::object& progress) {
        MotionRegistrationRequest request{mode, period_s, std::move(at), grid_mm, spacing_mm, {}, {}};
        if (!landmarks.is_none()) request.landmarks = path_of(landmarks);
        if (!mask.is_none()) request.mask = path_of(mask);
        return register_scans(self, phases, folder, request, progress);
      },
      nb::arg("phases"), nb::arg("folder"), nb::kw_only(), nb::arg("mode") = "breath",
      nb::arg("period_s") = 4.0, nb::arg("at") = nb::make_tuple(), nb::arg("grid_mm") = 20.0,
      nb::arg("spacing_mm") = 4.0, nb::arg("landmarks") = nb::none(), nb::arg("mask") = nb::none(),
      nb::arg("progress") = nb::none(),
      nb::sig(
          "def register_phases(self, phases: Sequence[Scan | str | os.PathLike[str]], folder: str | "
          "os.PathLike[str], *, mode: str = 'breath', period_s: float = 4.0, at: Sequence[float] = (), "
          "grid_mm: float = 20.0, spacing_mm: float = 4.0, landmarks: str | os.PathLike[str] | None = None, "
          "mask: str | os.PathLike[str] | None = None, progress: xraycast._progress.Listener | None = None) "
          "-> list[dict[str, typing.Any]]"),
      "Registers the phases of a 4D CT to this scan, one of them, by the program elastix, and writes "
      "motion.json, "
      "its fields and report.png into a folder, as `xraycast motion` does.\n\n"
      "phases: the others, in their order.  mode: the movement's name.  period_s: of a cycle, or there and "
      "back.\n"
      "at: their phases, above 0, which is this scan's, and up to 1; else evenly spaced over a cycle.\n"
      "grid_mm: between the nodes of the B-spline.  spacing_mm: between those of the fields.\n"
      "landmarks: a CSV of pairs: the phase's number from 1, x, y, z in this scan, x, y, z in the phase, mm, "
      "LPS.\n"
      "mask: a scan, above 0 where the phases are to match.\n"
      "Returns for each phase how far it moves and the difference to this scan before and after.");
  scan.def("moved", moved, nb::arg("motion"), nb::kw_only(), nb::arg("phase") = nb::none(),
           nb::arg("time") = nb::none(), nb::arg("progress") = nb::none(),
           "The scan at an instant of its motion, on the same grid.\n\n"
           "motion: a motion.json.  phase: a dict of modes and their phases, 0 to 1; the others are at 0.\n"
           "time: instead, in seconds.");
}

}  // namespace xraycast::python
