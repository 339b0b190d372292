#include "body.hpp"
#include "calls/arguments.hpp"
#include "calls/job.hpp"
#include "calls/values.hpp"
#include "drawing.hpp"
#include "fluoroscope.hpp"
#include "run.hpp"
#include "scans/motion.hpp"
#include "scene.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/casting/key_maps.hpp"
#include "xraycast/drawing/still_picture.hpp"
#include "xraycast/export/export_request.hpp"
#include "xraycast/scene/map_motion.hpp"

#include <fmt/format.h>

#include <memory>
#include <nanobind/stl/string.h>

namespace xraycast::python {
namespace {

/// Of a map that moves: with fewer key maps, where those are given.
HeldBody with_keys(const HeldBody& body, const nb::object& keys) {
  if (keys.is_none()) return body;
  if (!body.map->keys) throw InputError("keys: the map stands still; leave it out");
  HeldBody fewer = body;
  fewer.map = std::make_shared<const BodyMap>(with_fewer_keys(*body.map, keys_of(keys)));
  return fewer;
}

/// How a map that moves does. A run tells which motion and modes it had; without one the vessels move by the
/// motion that is given, or that the map names.
BodyRequest page_body(const HeldBody& body, const HeldRun* run, bool has_vessels, const nb::object& motion,
                      const nb::object& phase, const nb::object& gate, double speed) {
  BodyRequest page = body_request_of(motion, phase);
  page.speed = speed;
  const auto gates = body_request_of(nb::none(), gate).phase;
  if (gates.size() > 1) throw InputError("gate: must be a dict of one mode and its phase");
  if (!gates.empty()) page.gate = PhaseGate{gates.begin()->first, gates.begin()->second};
  if (run != nullptr && run->request.body.motion) {
    if (page.motion || !page.phase.empty() || page.gate || speed != 1)
      throw InputError("run: has a motion of its own; leave out motion, phase, gate and motion_speed");
    return run->request.body;
  }
  std::vector<std::string> notes;  // check() tells of vessels that stay
  if (!page.motion && has_vessels) page.motion = motion_of(*body.map, {}, notes);
  return page;
}

/// The tree of vessels that are given.
HeldTree tree_in(const nb::object& vessels) {
  if (nb::isinstance<HeldTree>(vessels)) return nb::cast<HeldTree>(vessels);
  if (nb::isinstance<HeldVessels>(vessels)) {
    const auto& held = nb::cast<const HeldVessels&>(vessels);
    return {held.part(held.found->centrelines.tree)};
  }
  if (vessels.is_none() || nb::isinstance<HeldMesh>(vessels))
    throw InputError("live: steers in a tree; give Vessels, a VesselTree or its file as vessels");
  return {std::make_shared<const VesselTree>(read_tree(path_of(vessels)))};
}

/// A page that steers by itself.
void add_live(ExportRequest& request, const nb::object& vessels, const nb::object& live,
              const nb::object& devices, const nb::object& entry, const nb::object& exercises,
              const nb::object& fluoroscope) {
  if (live.is_none()) {
    if (!devices.is_none() || !entry.is_none() || !exercises.is_none() || !fluoroscope.is_none())
      throw InputError("devices, entry, exercise, fluoroscope: without live; leave them out");
    return;
  }
  if (request.format != ExportFormat::page) throw InputError("live: a scene steers nothing; write a .html");
  std::vector<std::string> names;
  if (!devices.is_none())
    for (const nb::handle device : devices)
      names.push_back(instrument_name(device, fmt::format("devices[{}]", names.size())));
  make_steered(request, run_of(tree_in(vessels), live, entry, nb::none(), nb::none(), "live"),
               instruments_named(names),
               fluoroscope.is_none() ? FluoroscopeRequest{} : fluoroscope_of(fluoroscope)->request);
  std::vector<Exercise> tasks;
  if (nb::isinstance<nb::str>(exercises)) throw InputError("exercise: must be a list of files, not a text");
  if (!exercises.is_none())
    for (const nb::handle file : exercises)
      tasks.push_back(read_exercise(path_of(file), *request.trainer->tree));
  add_exercises(request, tasks);
}

/// What the session shows but for what is given in its place.
ExportRequest session_of(const HeldBody& body, const nb::object& session, bool has_vessels, bool has_run) {
  ViewSession scene;
  if (!session.is_none()) scene = read_session(path_of(session));
  if (has_vessels) scene.vessels.clear();
  if (has_vessels || has_run) scene.steered.reset();
  scene.map = "body";
  ExportRequest request = exported_session(scene, body.map);
  request.is_of_session = !session.is_none();
  return request;
}

void export_session(const HeldBody& body, nb::handle path, const nb::object& vessels, const HeldRun* run,
                    const std::string& title, const std::string& precision, double contrast_mg_ml,
                    const nb::object& session, const PathArgument& motion, const PhaseArgument& phase,
                    const PhaseArgument& gate, double motion_speed, const KeysArgument& keys,
                    const nb::object& live, const nb::object& devices, const nb::object& entry,
                    const nb::object& exercise, const nb::object& fluoroscope, const nb::object& objects,
                    const nb::object& progress) {
  const std::string file = path_of(path);
  const ExportFormat format = export_format(file);
  check_writable(file);
  ExportRequest request = session_of(with_keys(body, keys), session, !vessels.is_none(), run != nullptr);
  request.format = format;
  request.title = title;
  request.precision = parse_map_precision(precision);
  if (!vessels.is_none()) {
    request.vessels = scene_of({vessels, nb::none(), contrast_mg_ml}).vessels;
    request.vessels_name = "vessels";
  }
  request.implants = surfaces_of(scene_of({nb::none(), nb::none(), contrast_mg_ml, {}, objects}).implants);
  request.body = page_body(body, run, request.vessels.has_value(), motion, phase, gate, motion_speed);
  if (run != nullptr) {
    check_recordable(*run->request.script);
    request.run = run->recorded;
  }
  add_live(request, vessels, live, devices, entry, exercise, fluoroscope);
  warn(check(request));
  run_job(progress, [&](Progress& reported) {
    reported.begin("exporting", 1, "files");
    if (format == ExportFormat::page)
      draw([&](Renderer& renderer) { request.still_png = still_png(renderer, request); });
    write_whole_file(file, export_bytes(request));
    reported.advance();
  });
}

}  // namespace

void add_export(nb::module_& module) {
  const ExportRequest usual;
  const std::string signature = fmt::format(
      "def export(body: BodyMap, path: str | os.PathLike[str], *, "
      "vessels: Vessels | VesselTree | Mesh | str | os.PathLike[str] | None = None, run: Run | None = None, "
      "title: str = '{}', precision: str = 'byte', contrast_mg_ml: float = {:.1f}, "
      "session: str | os.PathLike[str] | None = None, motion: str | os.PathLike[str] | None = None, "
      "phase: dict[str, float] | None = None, gate: dict[str, float] | None = None, motion_speed: float = "
      "1.0, "
      "keys: dict[str, int] | None = None, "
      "live: collections.abc.Sequence[str | os.PathLike[str]] | None = None, "
      "devices: collections.abc.Sequence[str | os.PathLike[str]] | None = None, "
      "entry: int | str | numpy.typing.ArrayLike | None = None, "
      "exercise: collections.abc.Sequence[str | os.PathLike[str]] | None = None, "
      "fluoroscope: Fluoroscope | None = None, "
      "objects: collections.abc.Sequence[Implant] | None = None, "
      "progress: xraycast._progress.Listener | None = None) "
      "-> None",
      usual.title, kUsualContrast_mg_ml);
  module.def(
      "export", export_session, nb::arg("body"), nb::arg("path"), nb::kw_only(),
      nb::arg("vessels") = nb::none(), nb::arg("run").none() = nb::none(), nb::arg("title") = usual.title,
      nb::arg("precision") = "byte", nb::arg("contrast_mg_ml") = kUsualContrast_mg_ml,
      nb::arg("session") = nb::none(), nb::arg("motion") = nb::none(), nb::arg("phase") = nb::none(),
      nb::arg("gate") = nb::none(), nb::arg("motion_speed") = 1.0, nb::arg("keys") = nb::none(),
      nb::arg("live") = nb::none(), nb::arg("devices") = nb::none(), nb::arg("entry") = nb::none(),
      nb::arg("exercise") = nb::none(), nb::arg("fluoroscope") = nb::none(), nb::arg("objects") = nb::none(),
      nb::arg("progress") = nb::none(), nb::sig(signature.c_str()),
      "Writes a BodyMap, with vessels and a run, as one web page that any browser opens (.html), or without "
      "the map as a glTF scene (.glb).\n\n"
      "vessels: Vessels, a Mesh, a VesselTree, or a file or folder of these.  run: what simulate() gave.\n"
      "precision: how the page stores the map, `byte` or `half` (16 bits).\n"
      "contrast_mg_ml: iodine in the vessels.  session: a session saved by the viewer, for its camera, "
      "display and what else it shows.\n"
      "Of a map that moves, motion: that by which it was cast, by which vessels move (default: the file that "
      "the "
      "map names).  phase: a dict of modes that are held at first, and their phases, 0 to 1.  gate: a dict "
      "of one "
      "mode and the phase at which alone it is shown at first.  motion_speed: how fast the body moves at "
      "first.  "
      "keys: a dict of modes and how many of their key maps the page holds. A run has a motion of its own, "
      "in "
      "which it was simulated.\n"
      "live: instruments, the outermost first, of a page that steers: it simulates them by itself, in the "
      "vessels' tree.  devices: others that may be taken instead.  entry: as Catheter's.  "
      "objects: a list of Implant, which lie in the body.  exercise: a list of files of tasks, to choose in "
      "the page (docs/exercises.md).  "
      "fluoroscope: the page's own, of whose C-arm, dose, pulse rate, compression and seed it takes heed.");
}

}  // namespace xraycast::python
