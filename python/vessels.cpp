#include "vessels.hpp"

#include "job.hpp"
#include "scan.hpp"
#include "values.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/segmentation/centreline.hpp"
#include "xraycast/segmentation/seeds.hpp"
#include "xraycast/segmentation/segment.hpp"
#include "xraycast/segmentation/surface.hpp"

#include <cmath>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

namespace xraycast::python {
namespace {

struct HeldBranch {
  std::shared_ptr<const VesselTree> tree;
  std::size_t index;
  const VesselBranch& branch() const { return tree->branches()[index]; }
};

/// What would make a segmentation accept a seed.
const char* remedy(LostSeed::Cause cause, bool has_window) {
  switch (cause) {
    case LostSeed::Cause::window:
      return has_window ? "; give a window_hu that includes it, or leave window_hu out"
                        : "; give a window_hu that includes it";
    case LostSeed::Cause::chamber:
      return ", and counts as a heart chamber; raise max_radius_mm";
    default:
      return "; give seeds in a vessel";
  }
}

SegmentedVessels vessels_of(const HeldScan& scan, const SegmentOptions& options, Progress& progress) {
  const DeviceUse device;
  try {
    return segment_vessels(*scan.volume(), options, scan.source(), *device, progress);
  } catch (const LostSeed& error) {
    throw InputError("{}{}", error.what(), remedy(error.cause(), options.window_hu.has_value()));
  } catch (const NoContrast& error) {
    throw InputError("{}; check in the scan which are vessels, and give one by seeds=[(x, y, z)]",
                     error.what());
  }
}

SegmentOptions options_of(const nb::object& seeds, const nb::object& not_vessels, const nb::object& window,
                          double max_radius_mm) {
  SegmentOptions options;
  options.markers.vessels_mm = points_of(seeds, "seeds");
  options.markers.not_vessels_mm = points_of(not_vessels, "not_vessels");
  if (!(max_radius_mm > 0)) throw InputError("max_radius_mm {}: must be above zero", max_radius_mm);
  options.markers.max_radius_mm = max_radius_mm;
  if (window.is_none()) return options;
  const Numbers limits = numbers_of(window, "window_hu");
  if (limits.shape != std::vector<std::size_t>{2} || limits.values[0] >= limits.values[1])
    throw InputError("window_hu: must be (lowest, highest) in HU");
  options.window_hu = {limits.values[0], limits.values[1]};
  return options;
}

HeldVessels segmented(const HeldScan& scan, const SegmentOptions& options, const nb::object& root,
                      std::size_t triangles, const nb::object& progress) {
  if (triangles < 100) throw InputError("triangles {}: must be 100 or more", triangles);
  std::optional<glm::dvec3> root_mm;
  if (!root.is_none()) root_mm = point_of(root, "root_mm");
  return result_of(progress, [&](Progress& reported) {
    auto [voxels, fill] = vessels_of(scan, options, reported);
    auto mask = std::make_shared<const Mask>(std::move(voxels));
    Centrelines found = extract_centrelines(*mask, scan.source(), reported, root_mm, &fill);
    auto tree = std::make_shared<const VesselTree>(std::move(found.tree));
    if (root_mm)
      check_near_end(tree->branches()[static_cast<std::size_t>(tree->root())].points.front().position_mm,
                     *root_mm, "root_mm");
    reported.begin("surface", 1, "surfaces");
    auto surface = std::make_shared<const Mesh>(surface_of(*mask, fill, triangles));
    reported.advance();
    return HeldVessels{mask, {tree}, {surface}};
  });
}

auto voxels_of(const HeldVessels& vessels) {
  const Index3& size = vessels.mask->geometry.size;
  return array_over<const std::uint8_t, 3>(
      vessels.mask->voxels.data(),
      {static_cast<std::size_t>(size.z), static_cast<std::size_t>(size.y), static_cast<std::size_t>(size.x)},
      vessels.mask);
}

static_assert(sizeof(VesselPoint) == 4 * sizeof(double) && sizeof(glm::vec3) == 3 * sizeof(float));

auto points_of_branch(const HeldBranch& held) {
  const std::vector<VesselPoint>& points = held.branch().points;
  return array_over<const double, 2>(&points.front().position_mm.x, {points.size(), 4}, held.tree);
}

/// A tree of (points, parent) for each branch.
void make_tree(HeldTree* tree, const nb::sequence& branches) {
  std::vector<VesselBranch> list;
  for (const nb::handle item : branches) {
    const std::string name = fmt::format("branches[{}]", list.size());
    if (!nb::isinstance<nb::sequence>(item) || nb::len(item) != 2)
      throw InputError("{}: must be (points, parent)", name);
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
      .def_prop_ro("children", [](const HeldBranch& b) { return b.branch().children; })
      .def_prop_ro("length_mm", [](const HeldBranch& b) { return b.branch().arc_length_mm.back(); });
  nb::class_<HeldTree>(module, "VesselTree", "Centrelines with radii, as a connected tree of branches.")
      .def("__init__", make_tree, nb::arg("branches"),
           "branches: (points, parent) of each; points (n, 4): x, y, z and radius in mm, LPS, of which the "
           "first is the parent's last; parent: its number, -1 for the root.")
      .def("__reduce__", [](nb::handle self) { return reduced("tree", self); })
      .def_static(
          "read",
          [](nb::handle path) {
            return HeldTree{std::make_shared<const VesselTree>(read_tree(path_of(path)))};
          },
          nb::arg("path"), "Reads .vtp or .json, or the tree.vtp of a folder that `xraycast segment` wrote.")
      .def(
          "write", [](const HeldTree& t, nb::handle path) { write_tree(*t.tree, path_of(path)); },
          nb::arg("path"), "Writes .vtp (as VMTK) or .json.")
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
          "write", [](const HeldMesh& m, nb::handle path) { write_mesh(*m.mesh, path_of(path)); },
          nb::arg("path"), "Writes .vtp or .stl.")
      .def("__repr__", [](const HeldMesh& m) {
        return fmt::format("<xraycast.Mesh: {} triangles>", m.mesh->triangles.size());
      });
}

}  // namespace

void add_vessels(nb::module_& module) {
  add_tree(module);
  add_mesh(module);
  nb::class_<HeldVessels>(module, "Vessels", "The vessels of a scan.")
      .def_prop_ro("mask", voxels_of, kShared,
                   "1 in vessels, (z, y, x) uint8, on the scan's grid; no copy, read-only.")
      .def_prop_ro(
          "tree", [](const HeldVessels& v) { return v.tree; }, "The VesselTree.")
      .def_prop_ro(
          "surface", [](const HeldVessels& v) { return v.surface; }, "The Mesh of the mask's surface.")
      .def("__repr__", [](const HeldVessels& v) {
        return fmt::format("<xraycast.Vessels: {} branches>", v.tree.tree->branches().size());
      });
}

void add_segmentation(nb::module_& module, nb::class_<HeldScan>& scan) {
  add_vessels(module);
  scan.def(
      "segment",
      [](const HeldScan& self, const nb::object& seeds, const nb::object& not_vessels,
         const nb::object& window_hu, double max_radius_mm, const nb::object& root_mm, std::size_t triangles,
         const nb::object& progress) {
        return segmented(self, options_of(seeds, not_vessels, window_hu, max_radius_mm), root_mm, triangles,
                         progress);
      },
      nb::arg("seeds") = nb::tuple(), nb::kw_only(), nb::arg("not_vessels") = nb::tuple(),
      nb::arg("window_hu") = nb::none(), nb::arg("max_radius_mm") = Markers{}.max_radius_mm,
      nb::arg("root_mm") = nb::none(), nb::arg("triangles") = 50'000, nb::arg("progress") = nb::none(),
      "The Vessels of a CT angiography: mask, tree of centrelines, and surface.\n\n"
      "seeds: points (x, y, z) in vessels, mm, LPS; default: the largest vessels.\n"
      "not_vessels: points in structures to exclude, such as a vein that touches an artery.\n"
      "window_hu: (lowest, highest) CT number of the vessels; default: from the histogram.\n"
      "max_radius_mm: wider structures count as heart chambers.  root_mm: the tree begins at the end nearest "
      "to it.");
}

}  // namespace xraycast::python
