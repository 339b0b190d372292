#include "calls/arguments.hpp"
#include "calls/job.hpp"
#include "calls/values.hpp"
#include "scans/scan.hpp"
#include "vessels.hpp"
#include "xraycast/lesions/edit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace xraycast::python {
namespace {

/// Vessels with lesions, of a folder or tree.
struct HeldEdit {
  HeldVessels vessels;
  Edits edits;
  std::vector<Lesion> lesions;
  std::shared_ptr<const Volume> voxels;  ///< of a scan with the lesions
  std::string input;
};

nb::object parsed_json(const std::string& text) {
  return nb::module_::import_("json").attr("loads")(text_object(text));
}

Volume copy_of(const Volume& volume, const std::string& name) {
  Volume copy(volume.geometry(), name);
  std::copy(volume.hu().begin(), volume.hu().end(), copy.hu().begin());
  return copy;
}

HeldEdit edited_vessels(const PathArgument& vessels, const std::vector<std::string>& stenosis,
                        const std::vector<std::string>& aneurysm, const std::vector<std::string>& remove,
                        const std::vector<std::string>& scale, int random, std::uint64_t seed,
                        const nb::object& edits, const HeldScan* scan, const nb::object& progress) {
  EditRequest request;
  request.input = path_of(vessels);
  if (!edits.is_none()) request.edits = read_edits(path_of(edits));
  for (const std::string& words : stenosis) request.edits.stenoses.push_back(stenosis_of(words));
  for (const std::string& words : aneurysm) request.edits.aneurysms.push_back(aneurysm_of(words));
  request.edits.removed.insert(request.edits.removed.end(), remove.begin(), remove.end());
  for (const std::string& words : scale) request.edits.scales.push_back(scale_of(words));
  request.random = random;
  request.seed = seed;
  check(request);
  return result_of(progress, [&](Progress& reported) {
    std::optional<Volume> voxels;
    if (scan != nullptr) voxels.emplace(copy_of(*scan->volume(), scan->source()));
    EditedVessels made = edit_vessels(request, std::move(voxels), reported);
    HeldEdit held{.vessels = {},
                  .edits = std::move(made.edits),
                  .lesions = std::move(made.lesions),
                  .voxels = {},
                  .input = request.input.string()};
    if (made.scan) held.voxels = std::make_shared<const Volume>(std::move(*made.scan));
    held.vessels = {std::make_shared<const Vessels>(std::move(made.vessels)),
                    scan != nullptr ? scan->info() : ScanInfo{},
                    {},
                    "edited, of " + request.input.string()};
    return held;
  });
}

void write_edit(const HeldEdit& held, const PathArgument& folder, const nb::object& progress) {
  const std::filesystem::path path = path_of(folder);
  run_job(progress, [&](Progress& reported) {
    EditedVessels edited{*held.vessels.found, held.edits, held.lesions, {}};
    if (held.voxels) edited.scan.emplace(copy_of(*held.voxels, "scan"));
    write_edited(edited, held.vessels.scan, held.input, path, reported);
  });
}

}  // namespace

void add_edit(nb::module_& module) {
  nb::class_<HeldEdit>(module, "EditedVessels", "Vessels with lesions: what edit() gives.")
      .def_ro("vessels", &HeldEdit::vessels, "The Vessels: tree, surface and mask.")
      .def_prop_ro(
          "lesions",
          [](const HeldEdit& e) -> nb::typed<nb::list, nb::dict> {
            return nb::borrow<nb::typed<nb::list, nb::dict>>(parsed_json(lesions_text(e.lesions)));
          },
          "Of each: kind, branch, vessel, at_mm, place_mm, length_mm, reference_mm and least_mm (diameters), "
          "and of an aneurysm its sac: branch, centre_mm, diameter_mm, neck_mm.")
      .def_prop_ro(
          "edits",
          [](const HeldEdit& e) -> nb::typed<nb::list, nb::dict> {
            return nb::borrow<nb::typed<nb::list, nb::dict>>(parsed_json(edits_text(e.edits)));
          },
          "What was made, as in edits.json; those that were drawn by chance are among them.")
      .def_prop_ro(
          "scan",
          [](const HeldEdit& e) -> nb::object {
            if (!e.voxels) return nb::none();
            return nb::cast(HeldScan(copy_of(*e.voxels, "scan"), e.vessels.scan, e.vessels.origin));
          },
          nb::sig("def scan(self) -> Scan | None"),
          "A copy of the Scan with the lesions; None where none was given.")
      .def("write", write_edit, nb::arg("folder"), nb::kw_only(), nb::arg("progress") = nb::none(),
           nb::sig("def write(self, folder: str | os.PathLike[str], *, progress: xraycast._progress.Listener "
                   "| None = None) -> None"),
           "Writes the files of Vessels.write, edits.json and, of a scan, edited.nii.gz: all or none.")
      .def("__repr__", [](const HeldEdit& e) {
        return fmt::format("<xraycast.EditedVessels: {} lesions>", e.lesions.size());
      });
  module.def(
      "edit", edited_vessels, nb::arg("vessels"), nb::kw_only(),
      nb::arg("stenosis") = std::vector<std::string>(), nb::arg("aneurysm") = std::vector<std::string>(),
      nb::arg("remove") = std::vector<std::string>(), nb::arg("scale") = std::vector<std::string>(),
      nb::arg("random") = 0, nb::arg("seed") = EditRequest{}.seed, nb::arg("edits") = nb::none(),
      nb::arg("scan").none() = nb::none(), nb::arg("progress") = nb::none(),
      nb::sig("def edit(vessels: str | os.PathLike[str], *, stenosis: collections.abc.Sequence[str] = [], "
              "aneurysm: collections.abc.Sequence[str] = [], remove: collections.abc.Sequence[str] = [], "
              "scale: collections.abc.Sequence[str] = [], random: int = 0, seed: int = 1, "
              "edits: str | os.PathLike[str] | None = None, scan: Scan | None = None, "
              "progress: xraycast._progress.Listener | None = None) -> EditedVessels"),
      "Narrows, widens and removes vessels of a tree and gives them aneurysms, as `xraycast edit` does.\n\n"
      "vessels: a folder that segment, vessels, phantom --truth or edit wrote, or a tree's file.\n"
      "stenosis: 'BRANCH,AT_MM,LENGTH_MM,PERCENT' each, 75a for percent of the area; behind it eccentric or "
      "eccentric=SIDE, calcium or thrombus.\n"
      "aneurysm: 'X,Y,Z,DIAMETER_MM,NECK_MM' each, a point on the wall.\n"
      "remove: branches, with all behind them; scale: 'BRANCH,FACTOR', 'radii,FACTOR' or 'size,FACTOR'.\n"
      "random: so many lesions more, drawn by seed; edits: an edits.json, whose edits come first.\n"
      "scan: the scan of the vessels, which gets the lesions too.");
}

}  // namespace xraycast::python
