#include "body.hpp"

#include "calls/arguments.hpp"
#include "calls/job.hpp"
#include "calls/opacity.hpp"
#include "drawing.hpp"
#include "fluoroscope.hpp"
#include "frame.hpp"
#include "scans/motion.hpp"
#include "scans/scan.hpp"
#include "scene.hpp"
#include "vessels.hpp"
#include "xraycast/acquisition/map_acquisition.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/casting/basis_file.hpp"
#include "xraycast/casting/key_maps.hpp"
#include "xraycast/casting/recast.hpp"
#include "xraycast/reports/map_preview.hpp"
#include "xraycast/requests/cast_request.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"
#include "xraycast/scene/map_motion.hpp"
#include "xraycast/scene/same_scan.hpp"

#include <filesystem>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>

namespace xraycast::python {

/// A basis, and its weights on the device once a map was made from them.
struct HeldBasis {
  std::shared_ptr<const Basis> basis;
  std::optional<RecastSession> session{};
};

namespace {

std::shared_ptr<HeldBasis> held(Basis basis) {
  return std::make_shared<HeldBasis>(HeldBasis{std::make_shared<const Basis>(std::move(basis))});
}

/// From the scan as it is on the device where that serves, else from its slices.
Casting cast_held(HeldScan& scan, const CastRequest& request, Progress& progress) {
  const DeviceUse device;
  const auto open = [&](Progress&) {
    return Scan{scan.info(), std::make_unique<VolumeSource>(*scan.volume())};
  };
  Casting casting = takes_resident(request, scan.geometry(), *device)
                        ? cast(request, scan.resident(device), scan.outline(device, request.keep_table),
                               scan.hu_range(), progress)
                        : cast(request, open, *device, progress);
  casting.describe(scan.source(), frame_of_reference_uid(scan.info()));
  return casting;
}

HeldBody cast_scan(HeldScan& scan, const CastRequest& request, const nb::object& progress) {
  return result_of(progress, [&](Progress& reported) {
    Casting casting = cast_held(scan, request, reported);
    if (!casting.cut_off.empty()) casting.notes.push_back(casting.cut_off);
    if (!casting.left_out.empty()) casting.notes.push_back(casting.left_out);
    for (std::string& note : casting.notes) note = with_arguments(note);
    return HeldBody{std::make_shared<const BodyMap>(std::move(casting.map)),
                    casting.basis ? held(std::move(*casting.basis)) : nullptr, std::move(casting.notes)};
  });
}

std::shared_ptr<HeldBasis> cast_basis(HeldScan& scan, CastRequest request, const nb::object& progress) {
  request.makes_map = false;
  if (!request.knots_hu) request.knots_hu.emplace();
  check(request);
  return result_of(progress,
                   [&](Progress& reported) { return held(*cast_held(scan, request, reported).basis); });
}

HeldBody recast(HeldBasis& basis, const OpacityArgument& opacity, const ProgressArgument& progress) {
  const Opacity chosen = opacity_of(opacity, "recast");
  return result_of(progress, [&](Progress&) {
    const DeviceUse device;
    if (!basis.session) basis.session.emplace(*device, *basis.basis);
    return HeldBody{std::make_shared<const BodyMap>(basis.session->recast(chosen))};
  });
}

/// (layers, rows, angles) of values of a map.
auto map_array(const HeldBody& body, const std::vector<float>& values) {
  const MapGeometry& geometry = body.map->geometry;
  return array_over<const float, 3>(
      values.data(),
      {static_cast<std::size_t>(geometry.layers()), static_cast<std::size_t>(geometry.height),
       static_cast<std::size_t>(geometry.width)},
      body.map);
}

auto map_tau(const HeldBody& body) {
  if (body.map->spectrum())
    throw InputError("tau: this map holds the masses of materials, by a spectrum; see masses_g_cm2");
  return map_array(body, body.map->tau);
}

nb::dict map_masses(const HeldBody& body) {
  nb::dict masses;
  for (std::size_t i = 0; body.map->spectrum() && i < kMaterials.size(); ++i)
    masses[kMaterials[i].name] = nb::cast(map_array(body, body.map->depths[i]), kShared);
  return masses;
}

struct RenderArguments {
  SceneArguments scene;
  std::string look, compositing;
  const nb::object &fluoroscope, &motion, &phase, &time;
};

/// The instant: of a map that moves its phases, and the motion of the vessels in it; of one that stands still
/// that of the vessels.
struct MovedVesselsArguments {
  std::vector<double> phases{};
  std::shared_ptr<const Motion> moving{};
  MotionRequest still{};
};

MovedVesselsArguments moved_vessels_of(const HeldBody& body, const RenderArguments& given) {
  MovedVesselsArguments moved;
  const bool has_vessels = !given.scene.vessels.is_none();
  if (!body.map->keys) {
    if (given.motion.is_none()) {
      phases_at_instant(*body.map, given.phase, given.time);
      return moved;
    }
    moved.still = motion_request_of(given.motion, given.phase, given.time);
    if (!has_vessels)
      throw InputError("motion: moves vessels; give vessels, or leave it out: a map stays as it was cast");
    return moved;
  }
  moved.phases = phases_at_instant(*body.map, given.phase, given.time);
  if (!has_vessels) return moved;
  std::vector<std::string> notes;
  moved.moving = motion_of(
      *body.map,
      given.motion.is_none() ? std::filesystem::path() : std::filesystem::path(path_of(given.motion)), notes);
  warn(notes);
  return moved;
}

FrameOrFrames render(const HeldBody& body, const PoseArguments& arguments, const RenderArguments& given,
                     const nb::object& progress) {
  const MovedVesselsArguments moved = moved_vessels_of(body, given);
  SceneArguments arguments_of_scene = given.scene;
  arguments_of_scene.motion = moved.still;
  HeldScene scene = scene_of(arguments_of_scene);
  if (scene.vessels && !given.motion.is_none())
    check_same_instant(*body.map, "the map", "vessels" + scene.motion.suffix());
  PictureOptions picture;
  choose_look(given.look, picture);
  picture.style.sampling.compositing = parse_compositing(given.compositing);
  const auto held = fluoroscope_of(given.fluoroscope);
  if (held) picture.acquisition.fluoroscope = held->options;
  check(picture, scene.vessels.has_value(), !scene.instruments.empty() || !scene.implants.empty());
  const BodyBounds bounds = bounds_of(body.map->geometry);
  Poses poses = poses_of(arguments, [&](View view, bool has_centre) {
    if (!has_centre) view.centre_mm = bounds.centre_mm;
    return fitted(held ? on_c_arm(held->request, view) : view, bounds);
  });
  auto depths = result_of(progress, [&](Progress& reported) {
    auto drawn = room_for(poses.poses, false, held.has_value());
    reported.begin("drawing", std::ssize(poses.poses), "frames");
    draw([&](Renderer& renderer) {
      MapAcquisition frames(renderer,
                            {.map = body.map,
                             .vessels = scene.vessels,
                             .instruments = scene.instruments,
                             .implants = surfaces_of(scene.implants),
                             .motion = scene.vessels ? moved.moving : nullptr},
                            picture, std::get<View>(poses.poses.front()));
      frames.set_phases(moved.phases);
      for (const Pose& pose : poses.poses) {
        drawn->add(frames.frame(std::get<View>(pose)), frames.acquisition());
        reported.advance();
      }
    });
    return drawn;
  });
  return frames_object(std::move(depths), std::move(poses));
}

nb::bytes preview_png(const HeldBody& body) {
  const RgbPicture preview = map_preview(*body.map, PreviewWindow::automatic);
  const std::string bytes = png_bytes(preview.rgb, preview.width, preview.height, 3);
  return nb::bytes(bytes.data(), bytes.size());
}

/// `work` as the one unit of a stage.
template <typename Work>
auto whole(Progress& progress, const char* stage, const Work& work) {
  progress.begin(stage, 1, "files");
  auto result = work();
  progress.advance();
  return result;
}

HeldBody read_map(const PathArgument& path, const ProgressArgument& progress) {
  const std::string file = path_of(path);
  return result_of(progress, [&](Progress& reported) {
    return whole(reported, "reading",
                 [&] { return HeldBody{std::make_shared<const BodyMap>(read_body_map(file))}; });
  });
}

std::shared_ptr<HeldBasis> read_basis_file(const PathArgument& path, const ProgressArgument& progress) {
  const std::string file = path_of(path);
  return result_of(progress, [&](Progress& reported) {
    return whole(reported, "reading", [&] { return held(read_basis(file)); });
  });
}

/// Writes a map or a basis by `write`.
template <typename Write>
void write_file(nb::handle path, const nb::object& progress, const Write& write) {
  const std::string file = path_of(path);
  run_job(progress, [&](Progress& reported) {
    reported.begin("writing", 1, "files");
    write(file);
    reported.advance();
  });
}

HeldBody body_at(const HeldBody& body, const PhaseArgument& phase, const TimeArgument& time) {
  const std::vector<double> phases = phases_at_instant(*body.map, phase, time);
  return result_of(nb::none(), [&](Progress&) {
    return HeldBody{std::make_shared<const BodyMap>(map_at(*body.map, phases))};
  });
}

/// {mode: its key phases}
nb::typed<nb::dict, nb::str, nb::typed<nb::list, float>> modes_of(const HeldBody& body) {
  nb::dict modes;
  if (body.map->keys) {
    const KeyPhases& phases = body.map->keys->phases();
    for (std::size_t m = 0; m < phases.phases().size(); ++m) {
      nb::list of_mode;
      for (const double phase : phases.phases()[m]) of_mode.append(phase);
      modes[text_object(phases.rhythm().modes()[m].name)] = of_mode;
    }
  }
  return nb::borrow<nb::typed<nb::dict, nb::str, nb::typed<nb::list, float>>>(modes);
}

void write_map(const HeldBody& body, const PathArgument& path, const std::optional<std::string>& precision,
               const ProgressArgument& progress) {
  const MapPrecision stored = precision ? parse_map_precision(*precision) : body.map->precision;
  if (body.map->keys && stored != MapPrecision::byte)
    throw InputError("precision {}: a map that moves is stored in bytes; leave it out", *precision);
  check_map_name(path_of(path));
  write_file(path, progress, [&](const std::string& file) {
    if (stored == body.map->precision) return write_body_map(*body.map, file);
    BodyMap map = *body.map;
    map.precision = stored;
    write_body_map(map, file);
  });
}

void add_body(nb::module_& module) {
  nb::class_<HeldBody>(
      module, "BodyMap",
      "A scan's attenuation in concentric shells about the body's axis; frames are drawn from it "
      "without the scan.")
      .def_static("read", read_map, nb::arg("path"), nb::kw_only(), nb::arg("progress") = nb::none(),
                  "Reads a map that `xraycast cast` or write() wrote.")
      .def("write", write_map, nb::arg("path"), nb::kw_only(), nb::arg("precision") = nb::none(),
           nb::arg("progress") = nb::none(),
           "Writes the map, an OpenEXR file.\n\n"
           "precision: `float`, `half` (16 bits) or `byte` (scaled to the range of values of each layer); "
           "default: that of the file that was read, else `float`.")
      .def_prop_ro(
          "tau", map_tau, kShared,
          "Optical depth of each shell, (layers, rows, angles) float32, the innermost layer and the most "
          "superior row first, angle 0 anterior and growing towards the patient's left; no copy, read-only.")
      .def("__reduce__", [](nb::handle self) { return reduced("body_map", self); })
      .def_prop_ro(
          "radii_mm", [](const HeldBody& b) { return b.map->geometry.radii_mm; },
          "The shells' edges, innermost first, mm; layers + 1 of them.")
      .def_prop_ro("masses_g_cm2", map_masses,
                   "Of a map by a spectrum, which has no tau: what the rays meet in each shell, of `water`, "
                   "`bone` and "
                   "`iodine`, g/cm2, arrays as tau; empty for other maps.")
      .def_prop_ro(
          "opacity",
          [](const HeldBody& b) {
            return b.map->spectrum() ? std::nullopt : std::optional(b.map->opacity());
          },
          "None of a map by a spectrum.")
      .def_prop_ro(
          "basis", [](const HeldBody& b) { return b.basis; }, "The Basis, where cast() was given knots_hu.")
      .def_prop_ro(
          "modes", modes_of,
          "Of a map that moves: a dict of its modes and their key phases; empty where it stands still.")
      .def(
          "at", body_at, nb::kw_only(), nb::arg("phase") = nb::none(), nb::arg("time") = nb::none(),
          "Of a map that moves, that of an instant, which stands still; its tau is that of phase 0.\n\n"
          "phase: a dict of modes and their phases, 0 to 1; the others are at 0.  time: instead, in seconds.")
      .def_prop_ro(
          "notes", [](const HeldBody& b) { return text_objects(b.notes); },
          "What cast() chose, left out or advises.")
      .def(
          "render",
          [](const HeldBody& self, const ArrayArgument& lao, const ArrayArgument& cranial,
             const ArrayArgument& size, const ArrayArgument& cone_mm, const ArrayArgument& pixel_mm,
             const ArrayArgument& centre_mm, const VesselsArgument& vessels,
             const InstrumentsArgument& instruments, double contrast_mg_ml, const std::string& look,
             const std::string& compositing, const FluoroscopeArgument& fluoroscope,
             const PathArgument& motion, const PhaseArgument& phase, const TimeArgument& time,
             const ObjectsArgument& objects, const ProgressArgument& progress) {
            return render(self, {lao, cranial, size, cone_mm, pixel_mm, centre_mm},
                          {{vessels, instruments, contrast_mg_ml, {}, objects},
                           look,
                           compositing,
                           fluoroscope,
                           motion,
                           phase,
                           time},
                          progress);
          },
          nb::arg("lao") = 0, nb::arg("cranial") = 0, nb::arg("size") = nb::none(),
          nb::arg("cone_mm") = nb::none(), nb::kw_only(), nb::arg("pixel_mm") = nb::none(),
          nb::arg("centre_mm") = nb::none(), nb::arg("vessels") = nb::none(),
          nb::arg("instruments") = nb::none(), nb::arg("contrast_mg_ml") = kUsualContrast_mg_ml,
          nb::arg("look") = "fluoro", nb::arg("compositing") = "path", nb::arg("fluoroscope") = nb::none(),
          nb::arg("motion") = nb::none(), nb::arg("phase") = nb::none(), nb::arg("time") = nb::none(),
          nb::arg("objects") = nb::none(), nb::arg("progress") = nb::none(),
          "A Frame from any C-arm angle, or Frames if angles are lists; poses and fluoroscope are as in "
          "Scan.project. Drawn by OpenGL, in software if there is no GPU.\n\n"
          "vessels: Vessels, a VesselTree, a Mesh, or a file or folder, filled with contrast agent.\n"
          "instruments: a Catheter, CoaxialInstruments, an InstrumentShape, or a list of these.\n"
          "contrast_mg_ml: iodine in the vessels.  objects: a list of Implant.\n"
          "look: fluoro: vessels and instruments attenuate; surface: they are opaque, and depths end at "
          "them; dsa: depths are the differences from the picture without the vessels.\n"
          "compositing: how shells add up along a ray: path, by the path length in each, or wall, once per "
          "wall, as in the paper.\n"
          "phase, time: the instant of a map that moves, as in at(); default: phase 0.\n"
          "motion: moves the vessels, and has to be the one by which such a map was cast, which is its "
          "default; into a map that was cast at an instant, give motion and that instant. Instruments stay "
          "where they are.")
      .def(
          "preview",
          [](const HeldBody& self, const std::string& preview_window) {
            return picture_array(map_preview(*self.map, parse_preview_window(preview_window)));
          },
          nb::kw_only(), nb::arg("preview_window") = "auto", kShared,
          "The layers, the innermost first, with their radii and scales: (rows, columns, 3) uint8.\n\n"
          "preview_window: of greys, auto: from the map's values; paper: the transmission, unscaled.")
      .def("_repr_png_", preview_png, "PNG for notebooks: the layers, as preview().")
      .def("__repr__", [](const HeldBody& b) {
        const MapGeometry& g = b.map->geometry;
        return text_object(fmt::format("<xraycast.BodyMap of {}: {} layers of {} angles x {} rows>",
                                       b.map->source, g.layers(), g.width, g.height));
      });
}

void add_basis(nb::module_& module) {
  nb::class_<HeldBasis>(module, "Basis",
                        "The basis of a scan: maps with other opacities are recast from it in milliseconds.")
      .def_static("read", read_basis_file, nb::arg("path"), nb::kw_only(), nb::arg("progress") = nb::none())
      .def(
          "write",
          [](const HeldBasis& self, const PathArgument& path, const ProgressArgument& progress) {
            write_file(path, progress, [&](const std::string& file) { write_basis(*self.basis, file); });
          },
          nb::arg("path"), nb::kw_only(), nb::arg("progress") = nb::none())
      .def_prop_ro(
          "knots_hu", [](const HeldBasis& b) { return b.basis->knots_hu; },
          "The CT numbers at which the slope of an opacity may change.")
      .def("recast", recast, nb::arg("opacity"), nb::kw_only(), nb::arg("progress") = nb::none(),
           "A BodyMap with another opacity, all of whose knots must be among knots_hu.")
      .def("__repr__", [](const HeldBasis& b) {
        return fmt::format("<xraycast.Basis of {}: {} layers, {} knots>", b.basis->source,
                           b.basis->geometry.layers(), b.basis->knots_hu.size());
      });
}

using Radii = std::variant<std::string, std::vector<double>>;
using Centre = std::variant<HeldTree, std::vector<double>>;
using Path = std::filesystem::path;

/// Adds a method of Scan that makes something of a request, by all of its arguments.
template <typename Make>
void def_cast(nb::class_<HeldScan>& scan, const char* name, Make make, const std::string& purpose) {
  const auto call =
      [make](HeldScan& self, std::optional<int> layers, std::optional<int> angles,
             const OpacityArgument& opacity, const std::optional<std::string>& outline,
             const std::string& projection, std::optional<int> views, const std::optional<Radii>& radii,
             std::optional<double> radius_mm, const std::optional<Centre>& centre_mm,
             const std::optional<Path>& centre_line, bool keep_table, const std::optional<Path>& iodine,
             const std::optional<Path>& without_vessels, std::optional<std::int64_t> memory_limit_B,
             const std::optional<std::vector<double>>& knots_hu, const PathArgument& motion,
             const PhaseArgument& phase, const TimeArgument& time, const KeysArgument& keys,
             const ProgressArgument& progress) {
        CastRequest request{.projection = parse_ray_layout(projection),
                            .layers = layers,
                            .angles = angles,
                            .views = views,
                            .radius_mm = radius_mm,
                            .centre_line = centre_line.value_or("").string(),
                            .keep_table = keep_table,
                            .opacity = attenuation_of(opacity),
                            .iodine = iodine.value_or(""),
                            .without_vessels = without_vessels.value_or(""),
                            .motion = motion_request_of(motion, phase, time, true),
                            .keys = keys_of(keys),
                            .memory_limit_B = memory_limit_B,
                            .knots_hu = knots_hu};
        if (outline) request.outline = parse_shell_outline(*outline);
        if (const auto* rule = radii ? std::get_if<std::string>(&*radii) : nullptr)
          request.radii = parse_radii_rule(*rule);
        else if (radii)
          request.radii = std::get<std::vector<double>>(*radii);
        if (const auto* vessels = centre_mm ? std::get_if<HeldTree>(&*centre_mm) : nullptr)
          request.centre_mm = centre_of(*vessels->tree, request.projection);
        else if (centre_mm)
          request.centre_mm = std::get<std::vector<double>>(*centre_mm);
        check(request);
        return make(self, std::move(request), progress);
      };
  const std::string doc = purpose +
                          R"(

layers: concentric shells; default 1.  angles: rays per turn; default 360.
projection: `cylinder`, rays outwards from an axis; `sphere`, from a point; `rectangle`, parallel, with as many
pictures over 180 deg as `views`; default 36.
radii: `near-skin` (default), `equal-area` (default for circles), `equal-thickness`, or all edges in mm, innermost
first; with a body's outline, numbers up to 1 are fractions of it.
radius_mm: the outermost radius, which also limits the outline; default: encloses the body.
centre_mm: of the axis (x, y) or sphere (x, y, z), LPS, or the VesselTree whose centroid it is; default: the body's.
centre_line: a file of x,y,z in mm, or of a vessel tree, which the axis follows, or "body": it leans as the body.
outline: `body`: the shells follow the body's outline, without the table; `circle`: they are circles; default: the
body's, or circles if no body is found.  keep_table: the outline encloses everything, including the table.
opacity: as in project; a map by a spectrum holds masses_g_cm2.  iodine: with a spectrum, a file with a mask of
vessels, in which voxels brighter than blood count as iodine.
without_vessels: the folder of `xraycast segment`; the contrast agent is removed from its vessels.
memory_limit_B: larger scans are cast slab by slab; default: the device's largest buffer.
knots_hu: CT numbers at which the slope of other opacities may change, at most 64, for a basis; [] are the knots of
`opacity` and a standard set.
motion, phase, time: the scan is cast at an instant of its motion, as in Scan.moved. motion alone: a map that moves,
of key maps at phases of its modes.  keys: a dict of modes and the number of their phases; default 8 of a mode that
wraps, 4 of any other.)";
  scan.def(name, call, nb::arg("layers") = nb::none(), nb::arg("angles") = nb::none(), nb::kw_only(),
           nb::arg("opacity") = "paper", nb::arg("outline") = nb::none(), nb::arg("projection") = "cylinder",
           nb::arg("views") = nb::none(), nb::arg("radii") = nb::none(), nb::arg("radius_mm") = nb::none(),
           nb::arg("centre_mm") = nb::none(), nb::arg("centre_line") = nb::none(),
           nb::arg("keep_table") = false, nb::arg("iodine") = nb::none(),
           nb::arg("without_vessels") = nb::none(), nb::arg("memory_limit_B") = nb::none(),
           nb::arg("knots_hu") = nb::none(), nb::arg("motion") = nb::none(), nb::arg("phase") = nb::none(),
           nb::arg("time") = nb::none(), nb::arg("keys") = nb::none(), nb::arg("progress") = nb::none(),
           doc.c_str());
}

}  // namespace

void add_casting(nb::module_& module, nb::class_<HeldScan>& scan) {
  add_basis(module);
  add_body(module);
  def_cast(scan, "cast", cast_scan,
           "Casts the scan into a BodyMap of concentric layers, with a basis where knots_hu is given.");
  def_cast(scan, "cast_basis", cast_basis, "The Basis from which maps with other opacities are recast.");
}

}  // namespace xraycast::python
