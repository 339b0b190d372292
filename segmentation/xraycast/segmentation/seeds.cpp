#include "xraycast/segmentation/seeds.hpp"

#include "xraycast/mask/components.hpp"
#include "xraycast/mask/distance_transform.hpp"
#include "xraycast/mask/morphology.hpp"
#include "xraycast/segmentation/contrast.hpp"
#include "xraycast/segmentation/denoise.hpp"
#include "xraycast/segmentation/lumen_completion.hpp"
#include "xraycast/segmentation/other_vessels.hpp"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace xraycast {
namespace {

constexpr double kBrightTissue_hu = 70;  // without contrast agent
constexpr double kReach_mm = 5;          ///< of a seed that was set beside its vessel
constexpr double kAirBelow_hu = -300, kDensestContrast_hu = 700, kMetalFrom_hu = 2000;

constexpr const char* kElsewhere = "; give `seeds` in a vessel";
constexpr const char* kWiderRadius = ", and counts as a heart chamber; raise `max_radius_mm`";

InputError lost(const Seed& seed, const std::string& name, const std::string& where,
                const char* remedy = kElsewhere) {
  const glm::dvec3& p = seed.point_mm;
  return InputError("{}: the seed ({:.1f}, {:.1f}, {:.1f}) mm lies {} ({:.0f} HU){}", name, p.x, p.y, p.z,
                    where, seed.hu, remedy);
}

void check_brighter_than_tissue(const Seed& seed, const std::string& name) {
  if (seed.hu < kAirBelow_hu) throw lost(seed, name, "in air");
  if (seed.hu < kBrightTissue_hu) throw lost(seed, name, "in tissue without contrast agent");
}

/// The voxels within a distance of a point.
template <typename Visit>
void for_each_within(const VolumeGeometry& g, const glm::dvec3& point_mm, double radius_mm,
                     const Visit& visit) {
  const glm::dvec3 reach = radius_mm / g.spacing_mm, at = g.to_index(point_mm);
  const Index3 first = glm::max(Index3(glm::ceil(at - reach)), Index3(0)),
               last = glm::min(Index3(glm::floor(at + reach)), g.size - Index3(1));
  for (std::int64_t z = first.z; z <= last.z; ++z)
    for (std::int64_t y = first.y; y <= last.y; ++y)
      for (std::int64_t x = first.x; x <= last.x; ++x)
        if (glm::distance(g.to_world_mm({x, y, z}), point_mm) <= radius_mm) visit(Index3(x, y, z));
}

Seed look_at(const Volume& scan, const glm::dvec3& point_mm, double noise_hu) {
  const VolumeGeometry& g = scan.geometry();
  const glm::dvec3& s = g.spacing_mm;
  const Index3 here = glm::clamp(Index3(glm::round(g.to_index(point_mm))), Index3(0), g.size - Index3(1));
  const double own_hu = scan.at(here.x, here.y, here.z),
               reach_mm = std::max(2.0, 1.5 * std::max({s.x, s.y, s.z}));
  std::vector<double> alike;
  for_each_within(g, point_mm, reach_mm, [&](const Index3& v) {
    const double hu = scan.at(v.x, v.y, v.z);
    if (std::abs(hu - own_hu) <= std::max(3 * noise_hu, 10.0)) alike.push_back(hu);
  });
  if (alike.empty()) alike = {own_hu};
  const auto quantile = [&](double fraction) {
    const auto at =
        alike.begin() + static_cast<std::ptrdiff_t>(fraction * static_cast<double>(alike.size() - 1));
    std::ranges::nth_element(alike, at);
    return *at;
  };
  constexpr double kOfContrast = 0.2, kDeviations = 2.5;
  const double hu = quantile(0.5), spread_hu = 0.5 * (quantile(0.84) - quantile(0.16));
  return {point_mm, hu, std::max(kOfContrast * (hu - kSoftTissue_hu), kDeviations * spread_hu)};
}

/// The component of a mask that holds the voxel nearest to a point; an empty mask where there is none within
/// a distance of it.
Mask component_at(const Mask& mask, const glm::dvec3& point_mm, double reach_mm) {
  double nearest_mm = std::numeric_limits<double>::infinity();
  Index3 nearest(-1);
  for_each_within(mask.geometry, point_mm, reach_mm, [&](const Index3& v) {
    const double mm = glm::distance(mask.geometry.to_world_mm(glm::dvec3(v)), point_mm);
    if (mask[v] != 0 && mm < nearest_mm) nearest_mm = mm, nearest = v;
  });
  if (nearest.x < 0) return Mask(mask.geometry);
  const Components components(mask);
  std::vector<bool> keep(static_cast<std::size_t>(components.count()));
  keep[static_cast<std::size_t>(components.at(nearest))] = true;
  return components.select(keep);
}

/// What spheres of more than a radius reach within a mask, once thin structures within it are closed, such as
/// the vessels of an organ.
Mask wider_than(const Mask& mask, double radius_mm) {
  constexpr double kOrganVessels_mm = 4;
  const glm::dvec3& s = mask.geometry.spacing_mm;
  const double wall_mm = 0.5 * std::max({s.x, s.y, s.z});  // nearer than the next voxel's centre
  Mask closed(mask.geometry);
  const std::vector<float> to_mask_mm = distance_to_foreground_mm(mask);
  for (std::size_t i = 0; i < to_mask_mm.size(); ++i) closed.voxels[i] = to_mask_mm[i] <= kOrganVessels_mm;
  const std::vector<float> depth_mm = distance_to_background_mm(closed);
  Mask wide(mask.geometry);
  for (std::size_t i = 0; i < depth_mm.size(); ++i)
    wide.voxels[i] = depth_mm[i] - wall_mm > radius_mm + kOrganVessels_mm;
  if (wide.count() == 0) return wide;
  const std::vector<float> away_mm = distance_to_foreground_mm(wide);
  for (std::size_t i = 0; i < away_mm.size(); ++i)
    wide.voxels[i] = static_cast<std::uint8_t>(mask.voxels[i] != 0 && away_mm[i] <= radius_mm);
  return wide;
}

/// Whether most of what lies within two voxels around a mask is denser than `hu`.
bool is_enclosed_by_denser(const Mask& mask, const Volume& scan, const Index3& offset, double hu) {
  const Mask near = dilated(dilated(mask, Sharing::face), Sharing::face);
  std::int64_t around = 0, denser = 0;
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    if (near.voxels[i] == 0 || mask.voxels[i] != 0) continue;
    const Index3 v = voxel_at(mask.geometry, static_cast<std::int64_t>(i)) + offset;
    ++around;
    denser += scan.at(v.x, v.y, v.z) > hu;
  }
  return 2 * denser > around;
}

/// The voxels around a seed in a vessel too thin for one with six neighbours.
Mask thin_lumen_at(const Mask& alike, const Seed& seed, double reach_mm) {
  Mask near(alike.geometry);
  for_each_within(alike.geometry, seed.point_mm, reach_mm, [&](const Index3& v) { near[v] = alike[v]; });
  const glm::dvec3& s = alike.geometry.spacing_mm;
  return component_at(near, seed.point_mm, std::max({s.x, s.y, s.z}));
}

/// The lumen that is connected to one seed.
Mask lumen_at(const Volume& scan, const Seed& seed, const HuWindow& window, const Mask& body,
              const Markers& markers, const std::string& name) {
  Mask alike = between(scan, std::max(window.low_hu, seed.hu - seed.tolerance_hu),
                       std::min(window.high_hu, seed.hu + seed.tolerance_hu));
  intersect(alike, body);
  Mask lumen = component_at(eroded(alike, Sharing::face), seed.point_mm, 0.5 * kReach_mm);
  if (lumen.count() == 0) return thin_lumen_at(alike, seed, kReach_mm);
  constexpr double kMargin_mm = 6;  // more than anything below reaches
  const glm::dvec3& s = scan.geometry().spacing_mm;
  const auto margin = static_cast<std::int64_t>(std::ceil(kMargin_mm / std::min({s.x, s.y, s.z})));
  const Box box = grown(bounding_box(lumen), margin, scan.geometry().size);
  Mask part = crop(lumen, box);
  add_partial_volume_rim(crop(alike, box), part);
  if (is_enclosed_by_denser(part, scan, box.lower, seed.hu + seed.tolerance_hu))
    throw lost(seed, name, "in bone, which encloses it");
  const Mask wide = wider_than(part, markers.max_radius_mm);
  const Index3 here = glm::clamp(Index3(glm::round(part.geometry.to_index(seed.point_mm))), Index3(0),
                                 part.geometry.size - Index3(1));
  if (wide[here] != 0)
    throw lost(seed, name, fmt::format("in a structure wider than {:g} mm in radius", markers.max_radius_mm),
               kWiderRadius);
  subtract(part, wide);
  part = component_at(part, seed.point_mm, kReach_mm);
  std::ranges::fill(lumen.voxels, 0);
  paste(part, box, lumen);
  return lumen;
}

}  // namespace

std::optional<Volume> smoothed_for_seeds(const Volume& volume, ComputeDevice& device) {
  constexpr double kSigma_mm = 0.8, kWidest_vox = 1.5, kQuiet_hu = 5;
  if (measure_noise_hu(volume) <= kQuiet_hu) return std::nullopt;
  const glm::dvec3 sigma_vox = glm::min(kSigma_mm / volume.geometry().spacing_mm, glm::dvec3(kWidest_vox));
  return smoothed_scan(volume, sigma_vox, device);
}

std::vector<Seed> look_at_seeds(const Volume& scan, const Markers& markers) {
  const double noise_hu = measure_noise_hu(scan);
  std::vector<Seed> seeds;
  for (const glm::dvec3& point_mm : markers.vessels_mm) seeds.push_back(look_at(scan, point_mm, noise_hu));
  return seeds;
}

bool needs_own_window(const Seed& seed, const HuWindow& window, const Mask& mask) {
  if (seed.hu < kBrightTissue_hu || seed.hu > kDensestContrast_hu) return !is_near(mask, seed.point_mm);
  if (seed.hu > window.high_hu) return true;
  if (!is_near(mask, seed.point_mm)) return true;
  if (seed.hu >= window.low_hu) return false;
  // On the rim of a vessel a quarter and more of the sphere is vessel; voxels that noise alone has raised are
  // fewer than a tenth.
  constexpr double kBeside_mm = 2.5, kLeastFraction = 0.1;
  const glm::dvec3& s = mask.geometry.spacing_mm;
  double all = 0, inside = 0;
  for_each_within(mask.geometry, seed.point_mm, std::max(kBeside_mm, 1.5 * std::max({s.x, s.y, s.z})),
                  [&](const Index3& v) {
                    ++all;
                    inside += mask[v];
                  });
  return inside == 0 || inside < kLeastFraction * all;
}

HuWindow window_of_seeds(const std::vector<Seed>& seeds, const std::string& name) {
  for (const Seed& seed : seeds) {
    check_brighter_than_tissue(seed, name);
    if (seed.hu >= kMetalFrom_hu) throw lost(seed, name, "in metal");
    if (seed.hu > kDensestContrast_hu) throw lost(seed, name, "in bone");
  }
  double low_hu = kMaxHu, high_hu = kPaddingHu;
  for (const Seed& seed : seeds) {
    low_hu = std::min(low_hu, seed.hu - seed.tolerance_hu);
    high_hu = std::max(high_hu, seed.hu + seed.tolerance_hu);
  }
  return {low_hu, low_hu, high_hu};
}

bool is_near(const Mask& mask, const glm::dvec3& point_mm) {
  bool found = false;
  for_each_within(mask.geometry, point_mm, kReach_mm,
                  [&](const Index3& v) { found = found || mask[v] != 0; });
  return found;
}

Mask structure_at(const Mask& mask, const glm::dvec3& point_mm) {
  return component_at(mask, point_mm, kReach_mm);
}

void check_seeds(const std::vector<Seed>& seeds, const Mask& mask, Removal removal, const std::string& name) {
  for (const Seed& seed : seeds) {
    if (is_near(mask, seed.point_mm)) continue;
    check_brighter_than_tissue(seed, name);
    switch (removal) {
      case Removal::given_window:
        throw lost(seed, name, "outside the window of CT numbers",
                   "; give a `window_hu` that includes it, or leave `window_hu` out");
      case Removal::window:
        throw lost(seed, name, "outside the window of CT numbers", "; give a `window_hu` that includes it");
      case Removal::body:
        throw lost(seed, name, "outside the body", "; to use it all the same, give a mask by `from_mask`");
      case Removal::bone:
        throw lost(seed, name, "in bone");
      case Removal::chamber:
        throw lost(seed, name, "in a structure wider than the largest radius", kWiderRadius);
    }
  }
}

Mask lumen_at_seeds(const Volume& scan, const std::vector<Seed>& seeds, const HuWindow& window,
                    const Mask& body, const Markers& markers, const std::string& name) {
  Mask lumen(scan.geometry());
  if (seeds.empty()) return lumen;
  for (const Seed& seed : seeds) unite(lumen, lumen_at(scan, seed, window, body, markers, name));
  // What only touches at a neck is cut off here as well, and a point to exclude wins over a seed.
  Markers here{.vessels_mm = {}, .not_vessels_mm = {}, .max_radius_mm = markers.max_radius_mm};
  const auto is_in_it = [&](const glm::dvec3& p) { return is_near(lumen, p); };
  std::ranges::copy_if(markers.not_vessels_mm, std::back_inserter(here.not_vessels_mm), is_in_it);
  std::ranges::copy_if(markers.vessels_mm, std::back_inserter(here.vessels_mm), is_in_it);
  take_off_other_vessels(lumen, here, name);
  separate_chambers(lumen, here, name);
  Mask kept(lumen.geometry);
  for (const glm::dvec3& p : here.vessels_mm) unite(kept, component_at(lumen, p, kReach_mm));
  return kept;
}

}  // namespace xraycast
