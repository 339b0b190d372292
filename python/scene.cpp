#include "scene.hpp"

#include "calls/arguments.hpp"
#include "calls/job.hpp"
#include "calls/values.hpp"
#include "vessels.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/geometry/body_bounds.hpp"
#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/instrument_curve.hpp"
#include "xraycast/scene/vessels.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <optional>

namespace xraycast::python {
namespace {

Surface vessels_of(nb::handle vessels, double contrast_mg_ml) {
  HeldVessels segmented;
  HeldTree tree;
  HeldMesh mesh;
  if (nb::try_cast(vessels, segmented)) return filled_vessels(segmented.found->surface, contrast_mg_ml);
  if (nb::try_cast(vessels, tree)) return filled_vessels(tube_mesh(*tree.tree), contrast_mg_ml);
  if (nb::try_cast(vessels, mesh)) return filled_vessels(*mesh.mesh, contrast_mg_ml);
  return read_vessels(path_of(vessels), contrast_mg_ml);
}

/// Of one object; none for what is no instrument.
std::optional<std::vector<InstrumentShape>> shapes_of_one(nb::handle instrument) {
  if (InstrumentShape shape; nb::try_cast(instrument, shape)) return std::vector{shape};
  return steered_shapes(instrument);
}

std::vector<InstrumentShape> shapes_of(nb::handle instruments) {
  constexpr const char* kWhat =
      "instruments: must be a Catheter, CoaxialInstruments, an InstrumentShape, or a list of these";
  if (auto alone = shapes_of_one(instruments)) return *alone;
  if (!nb::isinstance<nb::sequence>(instruments)) throw InputError(kWhat);
  std::vector<InstrumentShape> all;
  for (const nb::handle one : nb::borrow<nb::sequence>(instruments)) {
    auto shapes = shapes_of_one(one);
    if (!shapes) throw InputError(kWhat);
    std::ranges::move(*shapes, std::back_inserter(all));
  }
  return all;
}

std::vector<Implant> implants_of(nb::handle objects) {
  if (!nb::isinstance<nb::sequence>(objects)) throw InputError("objects: must be a list of Implant");
  std::vector<Implant> implants;
  for (const nb::handle one : nb::borrow<nb::sequence>(objects))
    if (!nb::try_cast(one, implants.emplace_back())) throw InputError("objects: must be a list of Implant");
  return implants;
}

void make_implant(Implant* implant, nb::handle surface, const std::string& material,
                  std::optional<double> density_g_cm3, const PathArgument& pose) {
  std::vector<std::string> notes;
  Implant made;
  HeldMesh mesh;
  if (nb::try_cast(surface, mesh)) {
    if (!pose.is_none()) throw InputError("pose: moves a file's surface; move the mesh's own points");
    made = implant_of(*mesh.mesh, solid_named(material, density_g_cm3), "surface", notes);
  } else {
    made = read_implant({path_of(surface), material, density_g_cm3,
                         pose.is_none() ? std::filesystem::path() : std::filesystem::path(path_of(pose))},
                        notes);
  }
  new (implant) Implant(std::move(made));
  warn(notes);
}

constexpr double kLongest_mm = 5000;  // of an instrument, as of its models

void make_marker(MarkerModel* marker, double length_mm, double from_tip_mm, std::string material,
                 double thickness_mm) {
  MarkerModel made{.material = std::move(material),
                   .from_tip_mm = from_tip_mm,
                   .length_mm = length_mm,
                   .thickness_mm = thickness_mm};
  check({made}, kLargestRadius_mm, 0, kLongest_mm, "Marker");
  new (marker) MarkerModel(std::move(made));
}

std::vector<MarkerModel> markers_of(nb::handle markers) {
  constexpr const char* kWhat = "markers: must be a list of Marker";
  if (!nb::isinstance<nb::sequence>(markers)) throw InputError(kWhat);
  std::vector<MarkerModel> all;
  for (const nb::handle one : nb::borrow<nb::sequence>(markers))
    if (!nb::try_cast(one, all.emplace_back())) throw InputError(kWhat);
  return all;
}

/// NaN where a marker has yet to enter.
nb::ndarray<nb::numpy, double, nb::ndim<2>> marker_middles(const InstrumentShape& shape) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  const auto middles = std::make_shared<std::vector<glm::dvec3>>();
  for (const std::optional<glm::dvec3>& middle_mm : middles_of(shape.nodes_mm, shape.markers))
    middles->push_back(middle_mm.value_or(glm::dvec3(kNaN)));
  double* const first = middles->empty() ? nullptr : &middles->front().x;
  return array_over<double, 2>(first, {middles->size(), 3}, middles);
}

void make_shape(InstrumentShape* shape, const ArrayArgument& nodes_mm, double diameter_mm, bool is_wire,
                nb::handle markers) {
  constexpr std::size_t kFewest = 4;
  std::vector<glm::dvec3> nodes = points_of(nodes_mm, "nodes_mm");
  if (nodes.size() < kFewest) throw InputError("nodes_mm: must be at least {} points", kFewest);
  if (!(diameter_mm > 0 && std::isfinite(diameter_mm)))
    throw InputError("diameter_mm {:g}: must be above 0", diameter_mm);
  const double radius_mm = 0.5 * diameter_mm;
  std::vector<MarkerModel> made = markers.is_none()
                                      ? usual_markers(radius_mm, is_wire ? 0 : 0.5 * radius_mm, kLongest_mm)
                                      : markers_of(markers);
  if (!markers.is_none()) check(made, radius_mm, 0, kLongest_mm, "markers");
  new (shape) InstrumentShape{std::move(nodes), radius_mm, !is_wire, std::move(made)};
}

}  // namespace

std::vector<Surface> HeldScene::all() const {
  std::vector<Surface> surfaces = instruments;
  if (vessels) surfaces.push_back(*vessels);
  return surfaces;
}

HeldScene scene_of(const SceneArguments& arguments) {
  HeldScene scene;
  if (!arguments.vessels.is_none()) scene.vessels = vessels_of(arguments.vessels, arguments.contrast_mg_ml);
  if (scene.vessels && arguments.motion.is_given()) {
    std::vector<std::string> notes;
    scene = result_of(nb::none(), [&](Progress&) {
      MotionOfRequest motion = held_motion(arguments.motion);
      Surface vessels = moved(std::move(*scene.vessels), motion.held, "vessels", notes);
      return HeldScene{std::move(vessels), {}, std::move(motion), {}};
    });
    warn(notes);
  }
  if (!arguments.instruments.is_none())
    scene.instruments = steered_surfaces({.instruments = shapes_of(arguments.instruments)});
  if (!arguments.objects.is_none()) scene.implants = implants_of(arguments.objects);
  return scene;
}

void add_scene(nb::module_& module) {
  nb::class_<Implant>(
      module, "Implant",
      "An object in the body, such as a plate, a screw or a valve: a closed surface of one material.")
      .def("__init__", make_implant, nb::arg("surface"), nb::arg("material"), nb::kw_only(),
           nb::arg("density_g_cm3") = nb::none(), nb::arg("pose") = nb::none(),
           nb::sig("def __init__(self, surface: Mesh | str | os.PathLike[str], material: str, *, "
                   "density_g_cm3: float | None = None, pose: str | os.PathLike[str] | None = None) -> None"),
           "surface: a Mesh or its file, in the scan's mm, LPS.  material: titanium, titanium-alloy, steel, "
           "cobalt-chrome, nitinol, tantalum, tungsten, platinum, platinum-iridium, gold, alumina, "
           "polyethylene, "
           "bone-cement, an element's symbol, or a formula, which needs density_g_cm3.  pose: a JSON file "
           "with a "
           "`motion`, 3 x 4, by which the surface's points move.")
      .def_prop_ro("material", [](const Implant& i) { return i.material.name; })
      .def_prop_ro("density_g_cm3", [](const Implant& i) { return i.material.g_cm3; })
      .def_prop_ro(
          "per_mm", [](const Implant& i) { return surface_of(i).mu_per_mm; },
          "Its attenuation in a fluoroscopy beam, 1/mm, where water has 0.02.")
      .def("__repr__", [](const Implant& i) {
        return fmt::format("<xraycast.Implant of {}, {} triangles>", i.material.name,
                           i.mesh.triangles.size());
      });
  nb::class_<MarkerModel>(module, "Marker",
                          "A radiopaque band around an instrument, or the coil around a wire's tip.")
      .def("__init__", make_marker, nb::arg("length_mm"), nb::arg("from_tip_mm") = 0.0, nb::kw_only(),
           nb::arg("material") = "platinum", nb::arg("thickness_mm") = MarkerModel().thickness_mm,
           "from_tip_mm: of the instrument to the marker.  material: platinum, platinum-iridium, gold, "
           "tantalum or "
           "tungsten.  thickness_mm: of its wall; of a coil, that of a tube of as much metal.")
      .def_ro("length_mm", &MarkerModel::length_mm)
      .def_ro("from_tip_mm", &MarkerModel::from_tip_mm)
      .def_ro("material", &MarkerModel::material)
      .def_ro("thickness_mm", &MarkerModel::thickness_mm)
      .def("__repr__", [](const MarkerModel& m) {
        return fmt::format("<xraycast.Marker of {}, {:g} mm long, {:g} mm from the tip>", m.material,
                           m.length_mm, m.from_tip_mm);
      });
  nb::class_<InstrumentShape>(module, "InstrumentShape",
                              "An instrument's shape, with the diameter and material that frames show.")
      .def("__init__", make_shape, nb::arg("nodes_mm"), nb::arg("diameter_mm"), nb::kw_only(),
           nb::arg("is_wire") = false, nb::arg("markers") = nb::none(),
           nb::sig(
               "def __init__(self, nodes_mm: numpy.typing.ArrayLike, diameter_mm: float, *, is_wire: bool = "
               "False, markers: collections.abc.Sequence[Marker] | None = None) -> None"),
           "nodes_mm: from the introducer to the tip, (4 or more, 3), mm, LPS.  is_wire: of steel; else a "
           "catheter's radiopaque tubing.  markers: its bands; without, a wire has a coil of platinum over "
           "its "
           "last 30 mm, and a catheter none.")
      .def_prop_ro(
          "markers",
          [](const InstrumentShape& s) {
            nb::list markers;
            for (const MarkerModel& marker : s.markers) markers.append(nb::cast(marker));
            return markers;
          },
          nb::sig("def markers(self) -> list[Marker]"), "Its bands, as the instrument's model has them.")
      .def_prop_ro(
          "marker_middles_mm", marker_middles, kShared,
          "(markers, 3) float64, mm, LPS: the middle of each band; NaN of one that has yet to enter; a "
          "new array.")
      .def_prop_ro(
          "nodes_mm",
          [](const InstrumentShape& s) {
            const auto nodes = std::make_shared<std::vector<glm::dvec3>>(s.nodes_mm);
            return array_over<double, 2>(&nodes->front().x, {nodes->size(), 3}, nodes);
          },
          kShared, "(nodes, 3) float64, mm, LPS; a new array.")
      .def_prop_ro("diameter_mm", [](const InstrumentShape& s) { return 2 * s.radius_mm; })
      .def_prop_ro("is_wire", [](const InstrumentShape& s) { return !s.has_lumen; })
      .def_prop_ro(
          "per_mm", [](const InstrumentShape& s) { return instrument_parts(s).front().mu_per_mm; },
          "The attenuation of its shaft, 1/mm.")
      .def("__repr__", [](const InstrumentShape& s) {
        return fmt::format("<xraycast.InstrumentShape of {:.2f} mm{}>", 2 * s.radius_mm,
                           s.has_lumen ? "" : ", a wire");
      });
}

}  // namespace xraycast::python
