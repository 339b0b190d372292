#include "xraycast/segmentation/vessels.hpp"

#include "xraycast/attenuation/materials.hpp"
#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/geometry/branch_names.hpp"
#include "xraycast/image_file/write_volume.hpp"
#include "xraycast/mask/components.hpp"
#include "xraycast/radii/measured_vessels.hpp"
#include "xraycast/scan/scan.hpp"
#include "xraycast/segmentation/contrast.hpp"
#include "xraycast/segmentation/poor_results.hpp"
#include "xraycast/segmentation/surface.hpp"
#include "xraycast/segmentation/vessel_selection.hpp"
#include "xraycast/series/seg_file.hpp"
#include "xraycast/vessel_names/artery_names.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

Mask read_vessel_mask(const fs::path& file, const VolumeGeometry& grid, Progress& progress) {
  const Scan scan = open_scan(file.string(), {}, progress);
  check_mask_grid(scan.source->geometry(), grid, "`from_mask` " + file.string());
  return between(collect(*scan.source, progress, file.string()), 1, kMaxHu);
}

Mask given_mask(const GivenMask& given, const VolumeGeometry& grid, Progress& progress) {
  if (const auto* file = std::get_if<fs::path>(&given)) return read_vessel_mask(*file, grid, progress);
  const Mask& mask = *std::get<std::shared_ptr<const Mask>>(given);
  check_mask_grid(mask.geometry, grid, "`from_mask`");
  return mask;
}

/// The components with seeds; without seeds all but the smallest, whatever their shape, since the mask
/// defines the vessels.
Mask selected_components(const Mask& mask, const Markers& markers, const std::string& name,
                         Progress& progress, std::vector<std::string>& notes) {
  if (!markers.vessels_mm.empty()) return select_vessels(mask, markers, name, progress);
  Mask kept = without_small_components(mask);
  if (const std::int64_t dropped = mask.count() - kept.count(); dropped > 0)
    notes.push_back(
        fmt::format("{}: left out components of less than 1 % of the largest one, {} in all; give `seeds` in "
                    "one to keep it",
                    name, pluralize(dropped, "voxel")));
  return kept;
}

std::string of_own_seed(const GreatVessel& vessel, const std::string& name) {
  const glm::dvec3& p = vessel.middle_mm;
  return fmt::format(
      "{}: no contrast agent shows by itself; begun at ({:.0f}, {:.0f}, {:.0f}) mm with {:.0f} HU, by its "
      "place "
      "and shape the {}; look at the report, and give `seeds` in the vessels that are meant if these are "
      "others",
      name, p.x, p.y, p.z, vessel.hu, vessel.name);
}

SegmentedVessels vessels_of_given_mask(const Volume& volume, const SegmentRequest& request,
                                       Progress& progress, std::vector<std::string>& notes) {
  const auto* file = std::get_if<fs::path>(&request.from_mask);
  Mask mask = selected_components(given_mask(request.from_mask, volume.geometry(), progress), request.markers,
                                  file ? file->string() : "mask", progress, notes);
  LumenFill fill = fill_of(volume, mask);
  return {std::move(mask), std::move(fill)};
}

/// The contrast of a branch's points to what surrounds it.
std::vector<double> contrasts_hu(const VesselBranch& branch, const Volume& volume) {
  const VolumeGeometry& g = volume.geometry();
  const double voxel_mm = std::max({g.spacing_mm.x, g.spacing_mm.y, g.spacing_mm.z});
  const auto hu_at = [&](const glm::dvec3& p) {
    const Index3 voxel = glm::clamp(Index3(glm::round(g.to_index(p))), Index3(0), g.size - Index3(1));
    return static_cast<double>(volume.at(voxel.x, voxel.y, voxel.z));
  };
  std::vector<double> contrasts;
  for (const VesselPoint& point : branch.points) {
    std::vector<double> around_hu;
    for (const Index3& step : kNeighbours)
      around_hu.push_back(
          hu_at(point.position_mm + (2 * point.radius_mm + voxel_mm) * glm::normalize(glm::dvec3(step))));
    const auto middle = around_hu.begin() + static_cast<std::ptrdiff_t>(around_hu.size() / 2);
    std::ranges::nth_element(around_hu, middle);
    contrasts.push_back(hu_at(point.position_mm) - *middle);
  }
  return contrasts;
}

double weak_fraction(const VesselTree& tree, const Volume& volume, double noise_hu) {
  constexpr int kAlong = 5;  // points, of which the mean counts
  constexpr double kDeviations = 3;
  const double least_hu = kDeviations * noise_hu / std::sqrt(static_cast<double>(kAlong));
  double all_mm = 0, weak_mm = 0;
  for (const VesselBranch& branch : tree.branches()) {
    const std::vector<double> contrast_hu = contrasts_hu(branch, volume);
    const auto count = static_cast<int>(contrast_hu.size());
    for (int i = 1; i < count; ++i) {
      const int first = std::clamp(i - kAlong / 2, 0, std::max(0, count - kAlong)),
                last = std::min(count, first + kAlong);
      const double mean_hu =
          std::accumulate(contrast_hu.begin() + first, contrast_hu.begin() + last, 0.0) / (last - first);
      const auto at = static_cast<std::size_t>(i);
      const double mm = branch.arc_length_mm[at] - branch.arc_length_mm[at - 1];
      all_mm += mm;
      if (mean_hu < least_hu) weak_mm += mm;
    }
  }
  return all_mm > 0 ? weak_mm / all_mm : 0;
}

/// Says whether there was one.
bool remove_stale(const fs::path& file) {
  std::error_code error;
  if (fs::remove(file, error)) return true;
  if (!error) return false;
  throw InputError("{}: the file of an earlier run cannot be removed: {}; delete it", file.string(),
                   error.message());
}

}  // namespace

SurfaceKind surface_kind(const std::string& name) {
  if (name == "isosurface" || name == "level-set") return SurfaceKind::isosurface;
  if (name == "tubes") return SurfaceKind::tubes;
  throw InputError("`surface` {}: must be isosurface or tubes", name);
}

void check(const SegmentRequest& request) {
  const Markers& markers = request.markers;
  if (!(markers.max_radius_mm > 0) || std::isinf(markers.max_radius_mm))
    throw InputError("`max_radius_mm` {}: must be above zero", markers.max_radius_mm);
  if (request.triangles < 100) throw InputError("`triangles` {}: must be 100 or more", request.triangles);
  if (const auto& window = request.window_hu; window && !(window->first < window->second))
    throw InputError("`window_hu` {:g},{:g}: must be two CT numbers in HU, the lower one first",
                     window->first, window->second);
  if (!request.has_mask()) return;
  const auto reject = [](bool is_given, const char* field) {
    if (is_given)
      throw InputError("{} does not apply to `from_mask`, whose voxels are the vessels; leave it out", field);
  };
  reject(!markers.not_vessels_mm.empty(), "`not_vessels`");
  reject(request.window_hu.has_value(), "`window_hu`");
  reject(markers.max_radius_mm != Markers{}.max_radius_mm, "`max_radius_mm`");
  reject(static_cast<bool>(request.explain), "`explain`");
}

Vessels find_vessels(const Volume& volume, const SegmentRequest& request, const std::string& name,
                     ComputeDevice& device, Progress& progress) {
  check(request);
  const CancelScope scope(progress);
  SegmentLog log;
  std::vector<std::string> notes;
  const bool has_mask = request.has_mask();
  SegmentedVessels found = has_mask ? vessels_of_given_mask(volume, request, progress, notes)
                                    : segment_vessels(volume, request, name, device, progress, &log);
  if (log.own_seed) notes.push_back(of_own_seed(*log.own_seed, name));
  if (has_mask) log.noise_hu = measure_noise_hu(volume);
  Centrelines centrelines = extract_centrelines(found.mask, name, progress, request.root_mm, &found.fill);
  auto& [mask, fill] = found;
  const ScanOfTree scan{volume, log.noise_hu, log.scale.has_value()};
  // A mask's vessels end where it does, and those of parted systems may end where the other one begins.
  if (has_mask || !request.markers.not_vessels_mm.empty())
    centrelines.tree = measured_tree(centrelines.tree, scan, name, progress);
  else if (measure_and_follow(centrelines.tree, mask, fill, scan, name, progress) && request.explain)
    request.explain("longer-ends", mask);
  std::ranges::move(poor_results(centrelines, volume.geometry(), name), std::back_inserter(notes));
  if (request.is_automatic())
    std::ranges::move(too_little(centrelines.tree, volume.geometry(), name), std::back_inserter(notes));
  centrelines.tree = with_artery_names(centrelines.tree);
  std::ranges::move(
      request.root_mm ? far_root(centrelines.tree, request.root_mm, name) : wider_end(centrelines.tree, name),
      std::back_inserter(notes));
  const VesselTree& tree = centrelines.tree;
  progress.begin("surface", 1, "surfaces");
  Mesh surface =
      request.surface == SurfaceKind::tubes ? tube_mesh(tree) : surface_of(mask, fill, request.triangles);
  progress.advance();
  const double weak = weak_fraction(tree, volume, log.noise_hu);
  return {std::move(mask), std::move(fill), std::move(centrelines), std::move(surface), log, weak,
          std::move(notes)};
}

EditedNames write_vessels(const Vessels& vessels, const ScanInfo& scan, bool is_automatic,
                          const fs::path& folder, const Progress& progress) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw InputError("{}: the folder cannot be created: {}", folder.string(), error.message());
  const Mask& mask = vessels.mask;
  const bool has_seg = vessels.is_on_scan && why_no_seg(scan).empty();
  const CancelScope scope(progress);
  OutputSet outputs;
  if (vessels.is_on_scan) {
    write_mask(mask.geometry, mask.voxels, folder / "mask.nrrd");
    write_fractions(vessels.fill.geometry, vessels.fill.fractions, folder / "lumen.nrrd");
  }
  if (has_seg)
    write_seg(scan, mask.geometry.spacing_mm.z, mask.voxels, {is_automatic, XRAYCAST_VERSION},
              folder / kVesselSegFile);
  for (const char* name : {"tree.vtp", "tree.json"}) write_tree(vessels.centrelines.tree, folder / name);
  EditedNames names =
      with_edited_names(vessels.centrelines.tree, folder, vessels.is_on_scan ? &mask.geometry : nullptr);
  if (!names.is_all_taken)
    names.notes.push_back(fmt::format("{}: written anew; the earlier file is {}",
                                      (folder / kNamesFile).string(), keep_names(folder).string()));
  write_names(names.tree, folder / kNamesFile);
  for (const char* name : {"surface.vtp", "surface.stl"}) write_mesh(vessels.surface, folder / name);
  check_cancelled();
  outputs.commit();
  if (!has_seg) remove_stale(folder / kVesselSegFile);
  if (!vessels.is_on_scan)
    for (const char* name : {"mask.nrrd", "lumen.nrrd"})
      if (remove_stale(folder / name))
        names.notes.push_back(fmt::format(
            "{}: removed, as it was of other vessels; these have a mask where `like` gives a scan's grid",
            (folder / name).string()));
  return names;
}

void take_names(Vessels& vessels, EditedNames names) {
  vessels.centrelines.tree = std::move(names.tree);
  std::ranges::move(names.notes, std::back_inserter(vessels.notes));
}

}  // namespace xraycast
