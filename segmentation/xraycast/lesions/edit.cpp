#include "xraycast/lesions/edit.hpp"

#include "xraycast/attenuation/materials.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/given_vessels/surface_distance.hpp"
#include "xraycast/given_vessels/surface_lumen.hpp"
#include "xraycast/image_file/write_volume.hpp"
#include "xraycast/lesions/edited_lumen.hpp"
#include "xraycast/lesions/edited_scan.hpp"
#include "xraycast/lesions/edited_surface.hpp"
#include "xraycast/lesions/edited_tree.hpp"
#include "xraycast/lesions/placed_edits.hpp"
#include "xraycast/lesions/random_edits.hpp"
#include "xraycast/lesions/surface_cut.hpp"
#include "xraycast/lesions/tube_places.hpp"
#include "xraycast/lesions/vessel_folder.hpp"
#include "xraycast/lesions/wall_change.hpp"
#include "xraycast/segmentation/contrast.hpp"
#include "xraycast/segmentation/surface.hpp"

#include <fmt/ranges.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace xraycast {
namespace {

/// What is edited, one step after the other.
struct EditedFolder {
  VesselTree tree;
  Mesh surface;
  std::optional<VoxelLumen> lumen;
  std::optional<Volume> scan = {};
  double noise_hu = 0;  ///< of the scan
  std::vector<std::string> notes = {};
  Progress& progress;
};

// ---- surfaces of trees ----------------------------------------------------------------------------------

double thinnest_mm(const VesselTree& tree) {
  double least_mm = std::numeric_limits<double>::infinity();
  for (const VesselBranch& branch : tree.branches())
    for (const VesselPoint& point : branch.points) least_mm = std::min(least_mm, point.radius_mm);
  return least_mm;
}

/// The outer wall of a surface whose parts overlap.
Mesh one_wall(const Mesh& surface, const VesselTree& tree) {
  constexpr double kDistances = 4e6;
  const auto wall =
      surface_distance(surface, spacing_of_distances_mm(surface, thinnest_mm(tree), kDistances));
  constexpr std::size_t kTriangles = 60'000;
  return with_fewer_triangles(wall->wall(), std::max(kTriangles, 2 * surface.triangles.size()));
}

// ---- steps ----------------------------------------------------------------------------------------------

double plaque_hu(PlaqueKind plaque) {
  constexpr double kSoft_hu = 50, kCalcium_hu = 800, kThrombus_hu = 60;  // sources: edit.hpp
  return plaque == PlaqueKind::calcium    ? kCalcium_hu
         : plaque == PlaqueKind::thrombus ? kThrombus_hu
                                          : kSoft_hu;
}

/// Before the lumen changes.
void change_scan_of(EditedFolder& folder, const ScanChange& change) {
  if (!folder.scan) return;
  const ScanMatch match = change_scan(*folder.scan, *folder.lumen, change, folder.noise_hu, folder.progress);
  if (match.lumen_hu - match.tissue_hu < 3 * folder.noise_hu)
    folder.notes.push_back(fmt::format(
        "`scan`: vessels of {:.0f} HU hardly stand out of {:.0f} HU around them, so lesions hardly show",
        match.lumen_hu, match.tissue_hu));
}

/// How full of lumen the middles of what changes are: the median.
double middle_fill(const VoxelLumen& lumen, const WallChange& change) {
  std::vector<double> fills;
  for (const glm::dvec3& middle_mm : change.middles_mm())
    if (const Index3 voxel(glm::round(lumen.mask.geometry.to_index(middle_mm))); lumen.mask.contains(voxel))
      fills.push_back(lumen.fill.fractions[lumen.mask.offset(voxel)]);
  if (fills.empty()) return 1;
  std::ranges::nth_element(fills, fills.begin() + std::ssize(fills) / 2);
  return std::clamp(fills[fills.size() / 2] / LumenFill::kFull, 0.2, 1.0);
}

void change_scan_by(EditedFolder& folder, const WallChange& change, std::optional<double> wall_hu) {
  if (!folder.scan || change.is_empty()) return;
  change_scan_of(folder, {.box_mm = change.box_mm(),
                          .source = [&](const glm::dvec3& p) { return change.source(p); },
                          .wall_hu = wall_hu,
                          .middle_fill = middle_fill(*folder.lumen, change)});
}

void change_walls(EditedFolder& folder, const WallChange& change) {
  if (change.is_empty()) return;
  folder.progress.begin("moving walls", 1, "surfaces");
  folder.surface = moved_surface(folder.surface, change);
  if (folder.lumen)
    change_lumen(
        *folder.lumen, change.box_mm(), [&](const glm::dvec3& p) { return change.source(p); },
        folder.progress);
  folder.tree = change.after();
}

BoxMm box_of(const VesselTree& tree, const std::vector<bool>& counts) {
  glm::dvec3 lower(std::numeric_limits<double>::infinity()), upper = -lower;
  for (std::size_t b = 0; b < counts.size(); ++b)
    if (counts[b])
      for (const VesselPoint& point : tree.branches()[b].points) {
        lower = glm::min(lower, point.position_mm - 2 * point.radius_mm);
        upper = glm::max(upper, point.position_mm + 2 * point.radius_mm);
      }
  return {lower, upper};
}

double widest_of(const VesselTree& tree, const std::vector<bool>& counts) {
  double widest_mm = 0;
  for (std::size_t b = 0; b < counts.size(); ++b)
    if (counts[b])
      for (const VesselPoint& point : tree.branches()[b].points)
        widest_mm = std::max(widest_mm, point.radius_mm);
  return widest_mm;
}

void remove_branches(EditedFolder& folder, const std::vector<bool>& is_removed) {
  folder.progress.begin("removing branches", 1, "surfaces");
  if (piece_count(folder.surface) > 1) folder.surface = one_wall(folder.surface, folder.tree);
  folder.surface = without_branches(folder.surface, folder.tree, is_removed);
  std::vector<bool> is_kept = is_removed;
  is_kept.flip();
  const TubePlaces kept(folder.tree, is_kept), removed(folder.tree, is_removed);
  const double widest_mm = widest_of(folder.tree, is_removed);
  const auto source = [&](const glm::dvec3& p) {
    const TubePlace place = removed.deepest(p);
    const bool is_lost = place.out_mm < place.radius_mm + 1 && place.out_mm < kept.deepest(p).out_mm;
    return LumenSource{.kind = is_lost ? LumenSource::Kind::empty : LumenSource::Kind::same,
                       .out_mm = place.out_mm - widest_mm - 1};
  };
  const BoxMm box_mm = box_of(folder.tree, is_removed);
  change_scan_of(folder, {.box_mm = box_mm, .source = source, .wall_hu = {}});
  if (folder.lumen) change_lumen(*folder.lumen, box_mm, source, folder.progress);
  folder.tree = without_branches(folder.tree, is_removed);
}

/// Where a ball sits on the wall as it is now.
SacBall ball_of(const PlacedSac& sac, const VesselTree& given, const EditedFolder& folder) {
  const VesselPoint axis = point_at(given.branches()[static_cast<std::size_t>(sac.branch)], sac.at_mm);
  const TubePlace place = TubePlaces(folder.tree).deepest(axis.position_mm);
  const double wall_mm = wall_in_direction_mm(folder.surface, axis.position_mm, sac.outwards, place.radius_mm)
                             .value_or(place.radius_mm);
  return {.wall_mm = axis.position_mm + wall_mm * sac.outwards,
          .outwards = sac.outwards,
          .height_mm = sac.height_mm(),
          .radius_mm = 0.5 * sac.diameter_mm};
}

/// Adds an aneurysm; its lesion has no place yet.
Lesion add_sac(EditedFolder& folder, const PlacedSac& sac, const VesselTree& given) {
  folder.progress.begin("adding an aneurysm", 1, "surfaces");
  const SacBall ball = ball_of(sac, given, folder);
  std::optional<Mesh> surface = with_sac(folder.surface, ball);
  if (!surface) surface = with_sac(one_wall(folder.surface, folder.tree), ball);
  if (!surface)
    throw InputError(
        "`aneurysm` at {:.1f} mm of {}: its ball and the wall do not meet in one opening; make it smaller or "
        "move "
        "it along the vessel",
        sac.at_mm, given.title(sac.branch));
  folder.surface = std::move(*surface);
  const glm::dvec3 centre_mm = ball.centre_mm();
  const BoxMm box_mm{centre_mm - ball.radius_mm, centre_mm + ball.radius_mm};
  const auto source = [&](const glm::dvec3& p) {
    const double out_mm = glm::distance(p, centre_mm) - ball.radius_mm;
    return LumenSource{.kind = out_mm < 0 ? LumenSource::Kind::full : LumenSource::Kind::same,
                       .out_mm = out_mm};
  };
  change_scan_of(folder, {.box_mm = box_mm, .source = source, .wall_hu = {}});
  if (folder.lumen) change_lumen(*folder.lumen, box_mm, source, folder.progress);
  const TubePlace host = TubePlaces(folder.tree).deepest(ball.wall_mm);
  TreeWithSac edited = with_sac(folder.tree, ball, sac.neck_mm);
  folder.tree = std::move(edited.tree);
  return {.vessel = given.title(sac.branch),
          .place_mm = ball.wall_mm,
          .length_mm = sac.neck_mm,
          .reference_mm = 2 * host.radius_mm,
          .least_mm = 2 * host.radius_mm,
          .sac = Lesion::Sac{.centre_mm = ball.centre_mm(),
                             .diameter_mm = sac.diameter_mm,
                             .neck_mm = sac.neck_mm,
                             .branch = edited.branch}};
}

/// Adds all aneurysms. One that was drawn by chance, behind the first `asked`, is left out of the edits where
/// the surface has no room for it.
void add_sacs(EditedFolder& folder, const std::vector<PlacedSac>& sacs, const VesselTree& given,
              std::size_t asked, Edits& edits, std::vector<Lesion>& lesions) {
  std::vector<AneurysmEdit> made;
  for (std::size_t i = 0; i < sacs.size(); ++i) {
    try {
      lesions.push_back(add_sac(folder, sacs[i], given));
      made.push_back(edits.aneurysms[i]);
    } catch (const InputError& refusal) {
      if (i < asked) throw;
      folder.notes.push_back(fmt::format("`random`: left out: {}", refusal.what()));
    }
  }
  edits.aneurysms = std::move(made);
}

/// A stenosis in the changed tree; its place there is found at the end.
Lesion lesion_of(const PlacedStenosis& stenosis, const WallChange& change, const VesselTree& given) {
  const auto b = static_cast<std::size_t>(stenosis.branch);
  const VesselBranch& before = change.before().branches()[b];
  const auto middle = std::ranges::min_element(before.arc_length_mm, {},
                                               [&](double mm) { return std::abs(mm - stenosis.at_mm); });
  const VesselPoint& throat =
      change.after().branches()[b].points[static_cast<std::size_t>(middle - before.arc_length_mm.begin())];
  return {.vessel = given.title(stenosis.branch),
          .place_mm = throat.position_mm,
          .length_mm = stenosis.length_mm,
          .reference_mm = 2 * throat.radius_mm / (1 - stenosis.lost),
          .least_mm = 2 * throat.radius_mm,
          .sac = {}};
}

void scale_all(EditedFolder& folder, std::vector<Lesion>& lesions, double factor) {
  const glm::dvec3 fixed_mm =
      folder.tree.branches()[static_cast<std::size_t>(folder.tree.root())].points.front().position_mm;
  const auto place = [&](const glm::dvec3& p) { return fixed_mm + factor * (p - fixed_mm); };
  folder.tree = scaled(folder.tree, factor);
  for (glm::vec3& point_mm : folder.surface.points_mm) point_mm = place(point_mm);
  if (folder.lumen) {
    const VolumeGeometry& grid = folder.lumen->mask.geometry;
    const auto source = [&](const glm::dvec3& p) {
      return LumenSource{.kind = LumenSource::Kind::other, .from_mm = fixed_mm + (p - fixed_mm) / factor};
    };
    change_lumen(*folder.lumen, {grid.lower_mm(), grid.upper_mm()}, source, folder.progress);
  }
  for (Lesion& lesion : lesions) {
    lesion.place_mm = place(lesion.place_mm);
    lesion.length_mm *= factor;
    lesion.reference_mm *= factor;
    lesion.least_mm *= factor;
    if (!lesion.sac) continue;
    lesion.sac->centre_mm = place(lesion.sac->centre_mm);
    lesion.sac->diameter_mm *= factor;
    lesion.sac->neck_mm *= factor;
  }
}

/// Branches and arc lengths of lesions in the edited tree.
void place_lesions(std::vector<Lesion>& lesions, const VesselTree& tree) {
  std::vector<bool> is_vessel(tree.branches().size(), true);
  for (const Lesion& lesion : lesions)
    if (lesion.sac) is_vessel[static_cast<std::size_t>(lesion.sac->branch)] = false;
  const TubePlaces vessels(tree, is_vessel);
  for (Lesion& lesion : lesions) {
    if (lesion.sac) {  // which leaves the end of its vessel's first half
      lesion.branch = tree.branches()[static_cast<std::size_t>(lesion.sac->branch)].parent;
      lesion.at_mm = tree.branches()[static_cast<std::size_t>(lesion.branch)].arc_length_mm.back();
    } else {
      const TubePlace place = vessels.deepest(lesion.place_mm);
      lesion.branch = place.branch;
      lesion.at_mm = place.arc_length_mm(tree);
    }
    lesion.vessel = tree.title(lesion.branch);
  }
}

/// Voxels through which a throat leads hold it, however little of them it fills: a mask has no gap there.
void keep_throats_open(VoxelLumen& lumen, const std::vector<PlacedStenosis>& stenoses,
                       const WallChange& change) {
  for (const PlacedStenosis& stenosis : stenoses) {
    const auto b = static_cast<std::size_t>(stenosis.branch);
    const VesselBranch &before = change.before().branches()[b], &after = change.after().branches()[b];
    for (std::size_t k = 0; k < before.points.size(); ++k) {
      if (before.arc_length_mm[k] < stenosis.first_mm() || before.arc_length_mm[k] > stenosis.last_mm())
        continue;
      const Index3 voxel(glm::round(lumen.mask.geometry.to_index(after.points[k].position_mm)));
      const Index3 was(glm::round(lumen.mask.geometry.to_index(before.points[k].position_mm)));
      if (lumen.mask.contains(voxel) && lumen.mask.contains(was)) lumen.mask[voxel] = 1;
    }
  }
}

/// The lumen inside of a surface, on a scan's grid or one around it for pictures.
VoxelLumen lumen_within(const Mesh& surface, const VesselTree& tree, const VolumeGeometry* grid) {
  constexpr double kDistances = 4e6;
  constexpr std::int64_t kPictureVoxels = 20'000'000;
  const auto wall =
      surface_distance(surface, spacing_of_distances_mm(surface, thinnest_mm(tree), kDistances));
  LumenFill fill =
      fill_of(*wall, grid != nullptr ? *grid : grid_around(surface, kPictureVoxels, wall->spacing_mm()));
  Mask mask = half_full(fill);
  return {std::move(mask), std::move(fill)};
}

EditedFolder opened(const std::filesystem::path& input, std::optional<Volume> scan, Progress& progress) {
  VesselFolder given = read_vessel_folder(input, progress);
  Mesh surface = given.surface ? std::move(*given.surface) : one_wall(tube_mesh(given.tree), given.tree);
  EditedFolder folder{.tree = std::move(given.tree),
                      .surface = std::move(surface),
                      .lumen = std::move(given.lumen),
                      .scan = std::move(scan),
                      .progress = progress};
  if (!folder.scan) return folder;
  folder.noise_hu = measure_noise_hu(*folder.scan);
  if (folder.lumen)
    check_mask_grid(folder.lumen->mask.geometry, folder.scan->geometry(), (input / "mask.nrrd").string());
  else
    folder.lumen = lumen_within(folder.surface, folder.tree, &folder.scan->geometry());
  return folder;
}

/// Radii first: places along the vessels stay. Returns the lesions of stenoses.
std::vector<Lesion> narrow_and_widen(EditedFolder& folder, const PlacedEdits& placed,
                                     const VesselTree& given) {
  const WallChange scaled =
      wall_change(folder.tree, {.stenoses = {}, .sacs = {}, .is_removed = {}, .scales = placed.scales});
  change_scan_by(folder, scaled, {});
  change_walls(folder, scaled);
  const auto alone = [&](std::vector<PlacedStenosis> stenoses) {
    return PlacedEdits{.stenoses = std::move(stenoses),
                       .sacs = {},
                       .is_removed = {},
                       .scales = {.radii = std::vector<double>(placed.scales.radii.size(), 1)}};
  };
  if (folder.scan)
    for (const PlacedStenosis& stenosis : placed.stenoses)
      change_scan_by(folder, wall_change(folder.tree, alone({stenosis})), plaque_hu(stenosis.plaque));
  const WallChange narrowed = wall_change(folder.tree, alone(placed.stenoses));
  change_walls(folder, narrowed);
  if (folder.lumen) keep_throats_open(*folder.lumen, placed.stenoses, narrowed);
  std::vector<Lesion> lesions;
  for (const PlacedStenosis& stenosis : placed.stenoses)
    lesions.push_back(lesion_of(stenosis, narrowed, given));
  return lesions;
}

}  // namespace

void check(const EditRequest& request) {
  if (request.random < 0) throw InputError("`random` {}: must be 0 or more", request.random);
  if (request.edits.empty() && request.random == 0)
    throw InputError(
        "nothing is to be edited; give `stenosis`, `aneurysm`, `remove`, `scale`, `edits` or `random`");
}

EditedVessels edit_vessels(const EditRequest& request, std::optional<Volume> scan, Progress& progress) {
  check(request);
  const CancelScope scope(progress);
  progress.begin("reading", 1, "folders");
  EditedFolder folder = opened(request.input, std::move(scan), progress);
  const VesselTree given = folder.tree;
  Edits edits = with_random_edits(given, request.edits, request.random, request.seed, folder.notes);
  const PlacedEdits placed = placed_edits(given, edits);
  if (folder.scan && placed.scales.size != 1)
    throw InputError("`scale` {},{:g} does not apply to `scan`, whose body stays as large; leave one out",
                     ScaleEdit::kSize, placed.scales.size);

  std::vector<Lesion> lesions = narrow_and_widen(folder, placed, given);
  if (placed.removes_any()) remove_branches(folder, placed.is_removed);
  add_sacs(folder, placed.sacs, given, request.edits.aneurysms.size(), edits, lesions);
  if (placed.scales.size != 1) scale_all(folder, lesions, placed.scales.size);
  place_lesions(lesions, folder.tree);

  const bool has_mask = folder.lumen.has_value();
  VoxelLumen lumen = has_mask ? std::move(*folder.lumen) : lumen_within(folder.surface, folder.tree, nullptr);
  return {Vessels{std::move(lumen.mask),
                  std::move(lumen.fill),
                  {std::move(folder.tree), {}, {}, 0},
                  std::move(folder.surface),
                  {},
                  0,
                  std::move(folder.notes),
                  has_mask},
          edits, std::move(lesions), std::move(folder.scan)};
}

std::string edits_in_words(const EditedVessels& edited) {
  std::vector<std::string> words;
  for (const Lesion& lesion : edited.lesions) words.push_back(lesion.in_words());
  if (!edited.edits.removed.empty())
    words.push_back(pluralize(std::ssize(edited.edits.removed), "branch") + " removed");
  for (const ScaleEdit& scale : edited.edits.scales)
    words.push_back(fmt::format("{} times {:g}", scale.what, scale.factor));
  return fmt::format("edited: {}", fmt::join(words, "; "));
}

std::string edits_document(const EditedVessels& edited, const std::string& input) {
  return fmt::format("{{\"tree\": {},\n \"edits\": {},\n \"lesions\": {}}}\n", nlohmann::json(input).dump(),
                     edits_text(edited.edits), lesions_text(edited.lesions));
}

void write_edited(EditedVessels& edited, const ScanInfo& scan, const std::string& input,
                  const std::filesystem::path& folder, Progress& progress) {
  constexpr bool kIsAutomatic = false;
  OutputSet outputs;
  EditedNames names = write_vessels(edited.vessels, scan, kIsAutomatic, folder, progress);
  write_whole_file(folder / kEditsFile, edits_document(edited, input));
  if (edited.scan) write_volume(*edited.scan, folder / kEditedScanFile, progress);
  outputs.commit();
  take_names(edited.vessels, std::move(names));
}

}  // namespace xraycast
