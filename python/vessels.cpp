#include "vessels.hpp"

#include "calls/arguments.hpp"
#include "calls/job.hpp"
#include "calls/monitoring.hpp"
#include "calls/values.hpp"
#include "scans/scan.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/geometry/branch_names.hpp"
#include "xraycast/given_vessels/given_vessels.hpp"
#include "xraycast/reports/vessel_report.hpp"
#include "xraycast/segmentation/vessels.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

namespace xraycast::python {
namespace {

/// A property: a value in a part of the vessels.
template <typename Part, typename Value>
auto value_of(Part Vessels::*part, Value Part::*value) {
  return [=](const HeldVessels& vessels) { return (*vessels.found).*part.*value; };
}

struct HeldBranch {
  std::shared_ptr<const VesselTree> tree;
  std::size_t index;
  const VesselBranch& branch() const { return tree->branches()[index]; }
};

/// An array over the voxels of a grid.
auto array_of_voxels(const VolumeGeometry& grid, const std::uint8_t* voxels, const auto& keeper) {
  const Index3& size = grid.size;
  return array_over<const std::uint8_t, 3>(
      voxels,
      {static_cast<std::size_t>(size.z), static_cast<std::size_t>(size.y), static_cast<std::size_t>(size.x)},
      keeper);
}

auto array_of_mask(const std::shared_ptr<const Mask>& mask) {
  return array_of_voxels(mask->geometry, mask->voxels.data(), mask);
}

/// A mask from an array in which vessels are above zero, as in files.
std::shared_ptr<const Mask> mask_of(const nb::object& given, const VolumeGeometry& grid) {
  constexpr const char* kNumbers = "from_mask: must be numbers, above 0 in vessels";
  const nb::module_ numpy = nb::module_::import_("numpy");
  const nb::object numbers = numpy.attr("asarray")(given);
  const std::string kind = nb::cast<std::string>(numbers.attr("dtype").attr("kind"));
  if (kind.find_first_of("biuf") == std::string::npos) throw InputError("{}", kNumbers);
  if (kind == "f" && PyObject_IsTrue(numpy.attr("isnan")(numbers).attr("any")().ptr()) != 0)
    throw InputError("{}; it has NaN", kNumbers);
  const nb::object array =
      numpy_array(numpy.attr("greater")(numbers, nb::int_(0)), nb::str("bool"), kNumbers);
  const auto inside = nb::cast<nb::ndarray<const bool, nb::c_contig, nb::device::cpu>>(array);
  const auto is_along = [&](std::size_t axis, std::int64_t voxels) {
    return inside.shape(axis) == static_cast<std::size_t>(voxels);
  };
  if (inside.ndim() != 3 || !is_along(0, grid.size.z) || !is_along(1, grid.size.y) ||
      !is_along(2, grid.size.x))
    throw InputError("from_mask: must be of the scan's shape (z, y, x), {} x {} x {}", grid.size.z,
                     grid.size.y, grid.size.x);
  const auto mask = std::make_shared<Mask>(grid);
  std::copy_n(inside.data(), inside.size(), mask->voxels.begin());
  return mask;
}

GivenMask given_mask_of(const nb::object& given, const VolumeGeometry& grid) {
  if (given.is_none()) return {};
  if (nb::isinstance<HeldVessels>(given)) return nb::cast<const HeldVessels&>(given).mask();
  if (is_path(given)) return std::filesystem::path(path_of(given));
  return mask_of(given, grid);
}

/// A function of Python that is called from the thread of a job.
auto explaining(const nb::object& explain) {
  return [&explain](const std::string& step, const Mask& mask) {
    const nb::gil_scoped_acquire held;
    explain(text_object(step), array_of_mask(std::make_shared<const Mask>(mask)));
  };
}

SegmentRequest without_explain(SegmentRequest request) {
  request.explain = {};
  return request;
}

HeldVessels segmented(const HeldScan& scan, const nb::object& seeds, const nb::object& not_vessels,
                      const nb::object& window_hu, double max_radius_mm, const nb::object& from_mask,
                      const nb::object& root_mm, const std::string& surface, std::int64_t triangles,
                      const nb::object& explain, const nb::object& progress) {
  SegmentRequest request;
  request.markers = {points_of(seeds, "seeds"), points_of(not_vessels, "not_vessels"), max_radius_mm};
  if (!window_hu.is_none()) {
    const Numbers limits = numbers_of(window_hu, "window_hu");
    if (limits.shape != std::vector<std::size_t>{2})
      throw InputError("window_hu: must be (lowest, highest) in HU");
    request.window_hu = {limits.values[0], limits.values[1]};
  }
  request.from_mask = given_mask_of(from_mask, scan.geometry());
  if (!root_mm.is_none()) request.root_mm = point_of(root_mm, "root_mm");
  request.surface = surface_kind(surface);
  request.triangles = static_cast<std::size_t>(std::max<std::int64_t>(triangles, 0));
  if (!explain.is_none()) request.explain = explaining(explain);
  check(request);
  return result_of(progress, [&](Progress& reported) {
    const DeviceUse device;
    return HeldVessels{std::make_shared<const Vessels>(
                           find_vessels(*scan.volume(), request, scan.source(), *device, reported)),
                       scan.info(), without_explain(request)};
  });
}

nb::list write_files(const HeldVessels& vessels, nb::handle folder, const nb::object& progress) {
  const std::filesystem::path path = path_of(folder);
  return text_objects(result_of(progress, [&](Progress& reported) {
    return write_vessels(*vessels.found, vessels.scan, vessels.request.is_automatic(), path, reported).notes;
  }));
}

static_assert(sizeof(VesselPoint) == 4 * sizeof(double) && sizeof(glm::vec3) == 3 * sizeof(float));

auto points_of_branch(const HeldBranch& held) {
  const std::vector<VesselPoint>& points = held.branch().points;
  return array_over<const double, 2>(&points.front().position_mm.x, {points.size(), 4}, held.tree);
}

/// A tree of (points, parent) or (points, parent, name) for each branch.
void make_tree(HeldTree* tree, const nb::sequence& branches) {
  std::vector<VesselBranch> list;
  for (const nb::handle item : branches) {
    const std::string name = fmt::format("branches[{}]", list.size());
    if (!nb::isinstance<nb::sequence>(item) || (nb::len(item) != 2 && nb::len(item) != 3))
      throw InputError("{}: must be (points, parent) or (points, parent, name)", name);
    const Numbers points = numbers_of(item[0], name + ": points");
    if (points.shape.size() != 2 || points.shape[1] != 4)
      throw InputError("{}: points must be (points, 4): x, y, z and radius in mm", name);
    VesselBranch branch;
    for (std::size_t i = 0; i < points.values.size(); i += 4)
      branch.points.push_back(
          {{points.values[i], points.values[i + 1], points.values[i + 2]}, points.values[i + 3]});
    const double parent = number_of(item[1], name + ": parent");
    if (parent != std::floor(parent) || std::abs(parent) > 1e9)
      throw InputError("{}: parent must be the number of a branch, or -1 for the root", name);
    branch.parent = static_cast<int>(parent);
    if (nb::len(item) == 3) {
      if (!nb::isinstance<nb::str>(item[2])) throw InputError("{}: name must be text", name);
      branch.name = nb::cast<std::string>(item[2]);
      check_vessel_name(branch.name, name);
    }
    list.push_back(std::move(branch));
  }
  new (tree) HeldTree{std::make_shared<const VesselTree>(std::move(list), "branches")};
}

void add_tree(nb::module_& module) {
  nb::class_<HeldBranch>(module, "VesselBranch", "A vessel between two bifurcations or ends.")
      .def_prop_ro(
          "points", points_of_branch, kShared,
          "The centreline from the parent's side on, (points, 4) float64: x, y, z and radius in mm, LPS; no "
          "copy, read-only.")
      .def_prop_ro(
          "parent", [](const HeldBranch& b) { return b.branch().parent; },
          "The number of the branch that it leaves; -1 for the root.")
      .def_prop_ro(
          "name", [](const HeldBranch& b) { return text_object(b.branch().name); },
          "The vessel's name, which its other branches have too; empty for one that is not known.")
      .def_prop_ro("children", [](const HeldBranch& b) { return b.branch().children; })
      .def_prop_ro("length_mm", [](const HeldBranch& b) { return b.branch().arc_length_mm.back(); });
  nb::class_<HeldTree>(module, "VesselTree", "Centrelines with radii, as a connected tree of branches.")
      .def("__init__", make_tree, nb::arg("branches"),
           "branches: (points, parent) or (points, parent, name) of each; points (n, 4): x, y, z and radius "
           "in mm, LPS, of which the first is the parent's last; parent: its number, -1 for the root.")
      .def("__reduce__", [](nb::handle self) { return reduced("tree", self); })
      .def_static(
          "read",
          [](const PathArgument& path) {
            return HeldTree{std::make_shared<const VesselTree>(read_tree(path_of(path)))};
          },
          nb::arg("path"),
          "Reads .vtp or .json, or that of a folder that `xraycast segment` wrote, with the names of "
          "its names.json.")
      .def(
          "write", [](const HeldTree& t, const PathArgument& path) { write_tree(*t.tree, path_of(path)); },
          nb::arg("path"), "Writes .vtp (as VMTK) or .json; only .json has names.")
      .def(
          "named",
          [](const HeldTree& t, const std::string& name) {
            return branches_named(*t.tree, name, fmt::format("name \"{}\"", name));
          },
          nb::arg("name"), "The numbers of the branches of that name, in any case of letters.")
      .def(
          "exercise",
          [](const HeldTree& t, const PathArgument& path) {
            return exercise_object(read_exercise(path_of(path), *t.tree), *t.tree);
          },
          nb::arg("path"),
          "A task in this tree (docs/exercises.md) of a file, checked, as a dict: title, task, instruments "
          "and "
          "devices, presets or files; targets, of each its name, where it is (branch, arc_length_mm, at_mm, "
          "radius_mm), and whose tip is to reach it (instrument: 0 for the outermost; None: any); forbidden, "
          "of each name and branches; limits; and reference, a script or None.")
      .def_prop_ro(
          "branches",
          [](const HeldTree& t) {
            nb::typed<nb::list, HeldBranch> list;
            for (std::size_t i = 0; i < t.tree->branches().size(); ++i) list.append(HeldBranch{t.tree, i});
            return list;
          },
          "All branches, by their numbers.")
      .def_prop_ro(
          "root", [](const HeldTree& t) { return t.tree->root(); }, "The root's number.")
      .def("__len__", [](const HeldTree& t) { return t.tree->branches().size(); })
      .def(
          "__getitem__",
          [](const HeldTree& t, nb::ssize_t index) {
            const auto count = static_cast<nb::ssize_t>(t.tree->branches().size());
            if (index < -count || index >= count) throw nb::index_error("no such branch");
            return HeldBranch{t.tree, static_cast<std::size_t>(index < 0 ? index + count : index)};
          },
          nb::arg("index"))
      .def("__repr__", [](const HeldTree& t) {
        return fmt::format("<xraycast.VesselTree: {} branches>", t.tree->branches().size());
      });
}

void add_mesh(nb::module_& module) {
  nb::class_<HeldMesh>(module, "Mesh", "A triangle surface, normals outwards.")
      .def_prop_ro(
          "points_mm",
          [](const HeldMesh& m) {
            const auto& points = m.mesh->points_mm;
            return array_over<const float, 2>(points.empty() ? nullptr : &points.front().x,
                                              {points.size(), 3}, m.mesh);
          },
          kShared, "(points, 3) float32: x, y, z in mm, LPS; no copy, read-only.")
      .def_prop_ro(
          "triangles",
          [](const HeldMesh& m) {
            const auto& triangles = m.mesh->triangles;
            return array_over<const std::uint32_t, 2>(triangles.empty() ? nullptr : triangles.front().data(),
                                                      {triangles.size(), 3}, m.mesh);
          },
          kShared, "(triangles, 3) uint32: numbers of points; no copy, read-only.")
      .def(
          "write", [](const HeldMesh& m, const PathArgument& path) { write_mesh(*m.mesh, path_of(path)); },
          nb::arg("path"), "Writes .vtp or .stl.")
      .def("__repr__", [](const HeldMesh& m) {
        return fmt::format("<xraycast.Mesh: {} triangles>", m.mesh->triangles.size());
      });
}

}  // namespace

void add_vessels(nb::module_& module) {
  add_tree(module);
  add_mesh(module);
  nb::class_<HeldVessels>(module, "Vessels", "The vessels of a scan, and how they were found.")
      .def_prop_ro(
          "mask", [](const HeldVessels& v) { return array_of_mask(v.mask()); }, kShared,
          "1 in vessels, (z, y, x) uint8, on the scan's grid; no copy, read-only.")
      .def_prop_ro(
          "lumen",
          [](const HeldVessels& v) {
            const LumenFill& fill = v.found->fill;
            return array_of_voxels(fill.geometry, fill.fractions.data(), v.found);
          },
          kShared, "How full of lumen voxels are, 255 for full, (z, y, x) uint8; no copy, read-only.")
      .def_prop_ro(
          "tree", [](const HeldVessels& v) { return HeldTree{v.part(v.found->centrelines.tree)}; },
          "The VesselTree.")
      .def_prop_ro(
          "surface", [](const HeldVessels& v) { return HeldMesh{v.part(v.found->surface)}; }, "The Mesh.")
      .def_prop_ro(
          "lumen_mm3", [](const HeldVessels& v) { return v.found->fill.volume_mm3(); },
          "The volume of the lumen.")
      .def_prop_ro("noise_hu", value_of(&Vessels::log, &SegmentLog::noise_hu),
                   "The noise of the scan, a standard deviation.")
      .def_prop_ro(
          "window_hu",
          [](const HeldVessels& v) -> std::optional<std::pair<double, double>> {
            if (const auto& window = v.found->log.window) return std::pair(window->low_hu, window->high_hu);
            return std::nullopt;
          },
          "The lowest and highest CT number of vessels; None where they were found by other evidence.")
      .def_prop_ro(
          "evidence",
          [](const HeldVessels& v) -> std::optional<std::map<std::string, double>> {
            const auto& scale = v.found->log.scale;
            if (!scale) return std::nullopt;
            return std::map<std::string, double>{
                {"lumen_hu", scale->lumen_hu}, {"noise_hu", scale->noise_hu}, {"blur_vox", scale->blur_vox}};
          },
          "The lumen's contrast, the noise and the blur by which vessels were found without a window, or "
          "None.")
      .def_prop_ro(
          "weak_fraction", [](const HeldVessels& v) { return v.found->weak_fraction; },
          "The fraction of the tree's length that hardly stands out of the noise.")
      .def_prop_ro("loops", value_of(&Vessels::centrelines, &Centrelines::loops),
                   "The branches that closed a cycle, and were cut open there.")
      .def_prop_ro("gaps_mm", value_of(&Vessels::centrelines, &Centrelines::gaps_mm),
                   "The lengths of the lines that link components of the mask.")
      .def_prop_ro("parts_left_out", value_of(&Vessels::centrelines, &Centrelines::parts_left_out),
                   "How many components of the mask are too far from the others to be in the tree.")
      .def_prop_ro(
          "notes", [](const HeldVessels& v) { return text_objects(v.found->notes); },
          "What was left out of a given mask.")
      .def(
          "report",
          [](const HeldVessels& v, const HeldScan* scan) {
            if (scan != nullptr && v.origin.empty())
              return picture_array(vessel_report(scan->source(), *v.found, v.request, *scan->volume()));
            if (scan == nullptr)
              return picture_array(given_vessel_report("vessels", *v.found, v.origin, nullptr));
            return picture_array(
                given_vessel_report(scan->source(), *v.found, v.origin, scan->volume().get()));
          },
          nb::arg("scan").none() = nb::none(), kShared,
          "The picture of `xraycast segment`: the scan with the mask and the tree over it, and a table of "
          "the longest branches: (rows, columns, 3) uint8. Without a scan, over black.")
      .def("write", write_files, nb::arg("folder"), nb::kw_only(), nb::arg("progress") = nb::none(),
           nb::sig("def write(self, folder: str | os.PathLike[str], *, progress: xraycast._progress.Listener "
                   "| None = None) -> list[str]"),
           "Writes mask.nrrd, lumen.nrrd, tree.vtp, tree.json, surface.vtp, surface.stl and, for a DICOM "
           "series, mask.seg.dcm into a folder: all of them or none. Returns what became of an earlier "
           "folder's edited names and files, a line each.")
      .def("__repr__", [](const HeldVessels& v) {
        return fmt::format("<xraycast.Vessels: {} branches>", v.found->centrelines.tree.branches().size());
      });
}

void add_given_vessels(nb::module_& module) {
  module.def(
      "vessels",
      [](nb::handle input, const HeldScan* like, const std::string& unit, const std::string& frame,
         std::vector<std::string> labels, std::optional<double> radius_mm, const nb::object& component_mm,
         const nb::object& root_mm, std::int64_t triangles, const nb::object& progress) {
        GivenVesselsRequest request;
        request.input = path_of(input);
        request.unit_mm = unit_mm(unit);
        request.frame = patient_frame(frame);
        request.labels = std::move(labels);
        request.radius_mm = radius_mm;
        if (!component_mm.is_none()) request.options.component_mm = point_of(component_mm, "component_mm");
        if (!root_mm.is_none()) request.options.root_mm = point_of(root_mm, "root_mm");
        request.options.triangles = static_cast<std::size_t>(std::max<std::int64_t>(triangles, 0));
        check(request);
        return result_of(progress, [&](Progress& reported) {
          return HeldVessels{std::make_shared<const Vessels>(given_vessels(
                                 request, like != nullptr ? like->volume().get() : nullptr, reported)),
                             like != nullptr ? like->info() : ScanInfo{},
                             {},
                             "as given in " + request.input.string()};
        });
      },
      nb::arg("input"), nb::kw_only(), nb::arg("like").none() = nb::none(), nb::arg("unit") = "mm",
      nb::arg("frame") = "lps", nb::arg("labels") = std::vector<std::string>(),
      nb::arg("radius_mm") = nb::none(), nb::arg("component_mm") = nb::none(),
      nb::arg("root_mm") = nb::none(), nb::arg("triangles") = GivenVesselsOptions{}.triangles,
      nb::arg("progress") = nb::none(),
      nb::sig(fmt::format(
                  "def vessels(input: str | os.PathLike[str], *, like: Scan | None = None, unit: str = 'mm', "
                  "frame: str = 'lps', labels: collections.abc.Sequence[str] = [], "
                  "radius_mm: float | None = None, component_mm: numpy.typing.ArrayLike | None = None, "
                  "root_mm: numpy.typing.ArrayLike | None = None, triangles: int = {}, "
                  "progress: xraycast._progress.Listener | None = None) -> Vessels",
                  GivenVesselsOptions{}.triangles)
                  .c_str()),
      "The Vessels of a file that somebody brings, as `xraycast vessels` makes them: a surface, a mask, or "
      "centrelines.\n\n"
      "like: the scan that they are of; the mask is made on its grid.\n"
      "unit: of lengths, 'mm', 'cm', 'm' or 'um'; frame: 'lps' or 'ras', of a file that does not say its "
      "own.\n"
      "labels: structures of a mask that are vessels: numbers, or TotalSegmentator's names.\n"
      "radius_mm: of centrelines without radii.\n"
      "component_mm: of components that do not touch, the nearest to this point; default: the largest.\n"
      "root_mm: the tree begins at the vessel end nearest to it; default: at the widest, or where "
      "centrelines start.\n"
      "triangles: about how many, of a surface that is made anew.");
}

void add_segmentation(nb::module_& module, nb::class_<HeldScan>& scan) {
  add_vessels(module);
  add_given_vessels(module);
  const SegmentRequest usual;
  const std::string signature = fmt::format(
      "def segment(self, seeds: numpy.typing.ArrayLike = (), *, not_vessels: numpy.typing.ArrayLike = (), "
      "window_hu: tuple[float, float] | None = None, max_radius_mm: float = {:.1f}, "
      "from_mask: Vessels | numpy.typing.ArrayLike | str | os.PathLike[str] | None = None, "
      "root_mm: numpy.typing.ArrayLike | None = None, surface: str = 'isosurface', triangles: int = {}, "
      "explain: collections.abc.Callable[[str, numpy.ndarray], object] | None = None, "
      "progress: xraycast._progress.Listener | None = None) -> Vessels",
      usual.markers.max_radius_mm, usual.triangles);
  scan.def("segment", segmented, nb::arg("seeds") = nb::tuple(), nb::kw_only(),
           nb::arg("not_vessels") = nb::tuple(), nb::arg("window_hu") = nb::none(),
           nb::arg("max_radius_mm") = usual.markers.max_radius_mm, nb::arg("from_mask") = nb::none(),
           nb::arg("root_mm") = nb::none(), nb::arg("surface") = "isosurface",
           nb::arg("triangles") = usual.triangles, nb::arg("explain") = nb::none(),
           nb::arg("progress") = nb::none(), nb::sig(signature.c_str()),
           "The Vessels of a CT angiography: mask, tree of centrelines, and surface.\n\n"
           "seeds: points (x, y, z) in vessels, mm, LPS; default: the largest vessels.\n"
           "not_vessels: points in structures to exclude, such as a vein that touches an artery.\n"
           "window_hu: (lowest, highest) CT number of the vessels; default: from the histogram.\n"
           "max_radius_mm: wider structures count as heart chambers.\n"
           "from_mask: the vessels, instead of finding them: an array (z, y, x), Vessels, or a file.\n"
           "root_mm: the tree begins at the vessel end nearest to it; default: at the widest.\n"
           "surface: 'isosurface' of the smoothed mask, or 'tubes' along the centrelines; triangles: about "
           "how many.\n"
           "explain: a callable (step, mask), called after each step with the mask that it leaves.");
}

}  // namespace xraycast::python
