#include "body.hpp"
#include "calls/job.hpp"
#include "calls/values.hpp"
#include "drawing.hpp"
#include "run.hpp"
#include "scene.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/drawing/still_picture.hpp"
#include "xraycast/export/export_request.hpp"

#include <fmt/format.h>

#include <nanobind/stl/string.h>

namespace xraycast::python {
namespace {

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
                    const nb::object& session, const nb::object& progress) {
  const std::string file = path_of(path);
  const ExportFormat format = export_format(file);
  check_writable(file);
  ExportRequest request = session_of(body, session, !vessels.is_none(), run != nullptr);
  request.format = format;
  request.title = title;
  request.precision = parse_map_precision(precision);
  if (!vessels.is_none()) {
    request.vessels = scene_of({vessels, nb::none(), contrast_mg_ml}).vessels;
    request.vessels_name = "vessels";
  }
  if (run != nullptr) {
    check_recordable(*run->request.script);
    request.run = run->recorded;
  }
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
      "session: str | os.PathLike[str] | None = None, progress: xraycast._progress.Listener | None = None) "
      "-> None",
      usual.title, kUsualContrast_mg_ml);
  module.def(
      "export", export_session, nb::arg("body"), nb::arg("path"), nb::kw_only(),
      nb::arg("vessels") = nb::none(), nb::arg("run").none() = nb::none(), nb::arg("title") = usual.title,
      nb::arg("precision") = "byte", nb::arg("contrast_mg_ml") = kUsualContrast_mg_ml,
      nb::arg("session") = nb::none(), nb::arg("progress") = nb::none(), nb::sig(signature.c_str()),
      "Writes a BodyMap, with vessels and a run, as one web page that any browser opens (.html), or without "
      "the map as a glTF scene (.glb).\n\n"
      "vessels: Vessels, a Mesh, a VesselTree, or a file or folder of these.  run: what simulate() gave.\n"
      "precision: how the page stores the map, `byte` or `half` (16 bits).\n"
      "contrast_mg_ml: iodine in the vessels.  session: a session saved by the viewer, for its camera, "
      "display and what else it shows.");
}

}  // namespace xraycast::python
