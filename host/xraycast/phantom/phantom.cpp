#include "xraycast/phantom/phantom.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/phantom/phantom_bodies.hpp"

#include <fmt/ranges.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

struct Kind {
  const char* name;
  Index3 size;
  glm::dvec3 spacing_mm;
  double noise_hu;
  PhantomBody (*make)(const PhantomOptions& options);
  glm::dvec3 centre_mm = {0, 0, 0};
};

constexpr double kBodyNoise_hu = 10;

const Kind kKinds[] = {
    {"thorax", {512, 512, 720}, {0.78, 0.78, 1.0}, kBodyNoise_hu, make_thorax},
    {"head", {320, 384, 416}, {0.6, 0.6, 0.6}, kBodyNoise_hu, make_head},
    {"head-neck", {416, 256, 300}, {1.2, 1.2, 1.5}, kBodyNoise_hu, make_head_neck, {0, 0, -100}},
    {"abdomen", {512, 512, 160}, {0.75, 0.75, 1.5}, 15, make_abdomen, {0, 0, -40}},
    {"cylinder", {128, 128, 128}, {2, 2, 2}, 0, [](const PhantomOptions&) { return make_cylinder(); }},
    {"sphere", {128, 128, 128}, {2, 2, 2}, 0, [](const PhantomOptions&) { return make_sphere(); }},
    {"box", {128, 128, 128}, {2, 2, 2}, 0, [](const PhantomOptions&) { return make_box(); }},
    {"shepp-logan", {128, 128, 128}, {2, 2, 2}, 0, [](const PhantomOptions&) { return make_shepp_logan(); }},
};

const Kind& parse_kind(const std::string& name) {
  const auto kind = std::ranges::find_if(kKinds, [&](const Kind& k) { return k.name == name; });
  if (kind == std::end(kKinds))
    throw InputError("unknown phantom '{}'; choose one of {}", excerpt(name),
                     fmt::join(phantom_names(), ", "));
  return *kind;
}

VolumeGeometry geometry_of(const Kind& kind, const PhantomOptions& options) {
  VolumeGeometry geometry{kind.size, kind.spacing_mm, {0, 0, 0}};
  const glm::dvec3 extent_mm = glm::dvec3(kind.size) * kind.spacing_mm;
  if (options.spacing_mm) geometry.spacing_mm = glm::dvec3(*options.spacing_mm);
  if (options.size) geometry.size = *options.size;
  // Checked before the division, and again after the other one is computed.
  validate(geometry, fmt::format("phantom {}", kind.name));
  if (options.size && !options.spacing_mm) geometry.spacing_mm = extent_mm / glm::dvec3(geometry.size);
  if (options.spacing_mm && !options.size)
    geometry.size = glm::max(Index3(glm::round(glm::min(extent_mm / *options.spacing_mm, 1e9))), Index3(1));
  geometry.origin_mm = kind.centre_mm - 0.5 * geometry.spacing_mm * (glm::dvec3(geometry.size) - 1.0);
  validate(geometry, fmt::format("phantom {}", kind.name));
  return geometry;
}

/// The phase of each mode. Throws InputError.
std::vector<double> phases_of(const std::vector<PhantomMode>& modes,
                              const std::map<std::string, double>& named, const std::string& phantom) {
  for (const auto& [name, phase] : named) {
    std::vector<std::string> known;
    for (const PhantomMode& mode : modes) known.push_back(mode.name);
    if (known.empty())
      throw InputError("`phase` {}: the phantom {} does not move; make thorax or head, or give none",
                       excerpt(name), phantom);
    if (std::ranges::find(known, name) == known.end())
      throw InputError("`phase` {}: the phantom {} has no such movement; choose one of {}", excerpt(name),
                       phantom, fmt::join(known, ", "));
    if (!(phase >= 0 && phase <= 1)) throw InputError("`phase` {}: {} must be 0 to 1", name, phase);
  }
  std::vector<double> phases;
  for (const PhantomMode& mode : modes) {
    const auto found = named.find(mode.name);
    phases.push_back(found == named.end() ? 0 : found->second);
  }
  return phases;
}

std::vector<VesselBranch> moved(std::vector<VesselBranch> vessels, const PhantomMotion& motion) {
  if (motion.is_still()) return vessels;
  parallel_for(std::ssize(vessels), [&](std::int64_t vessel) {
    std::vector<VesselPoint>& points = vessels[static_cast<std::size_t>(vessel)].points;
    const std::vector<VesselPoint> rest = points;
    for (VesselPoint& point : points) point.position_mm = motion.moved_mm(point.position_mm);
    // A short piece of the vessel keeps its content: its cross-section grows by the volume's growth over the
    // length's.
    for (std::size_t i = 0; i < rest.size(); ++i) {
      const std::size_t before = i > 0 ? i - 1 : 0, after = std::min(i + 1, rest.size() - 1);
      const auto length_mm = [&](const std::vector<VesselPoint>& of) {
        return glm::distance(of[before].position_mm, of[after].position_mm);
      };
      const double volume = 1 / motion.gradient(points[i].position_mm).determinant();
      points[i].radius_mm *= std::sqrt(volume * length_mm(rest) / length_mm(points));
    }
  });
  return vessels;
}

/// Calls `visit(voxel, index)` for the voxels between two corners.
template <typename Visit>
void for_voxels(const VolumeGeometry& geometry, const glm::dvec3& lower_mm, const glm::dvec3& upper_mm,
                Visit visit) {
  const Index3 first = glm::max(Index3(glm::ceil(geometry.to_index(lower_mm))), Index3(0));
  const Index3 last = glm::min(Index3(glm::floor(geometry.to_index(upper_mm))), geometry.size - Index3(1));
  for (std::int64_t z = first.z; z <= last.z; ++z)
    for (std::int64_t y = first.y; y <= last.y; ++y)
      for (std::int64_t x = first.x; x <= last.x; ++x)
        visit(Index3(x, y, z), static_cast<std::size_t>((z * geometry.size.y + y) * geometry.size.x + x));
}

/// Of a moved body: the voxels that show a place in a vessel at rest.
std::vector<std::uint8_t> moved_vessel_mask(const Phantom& phantom) {
  const VolumeGeometry& geometry = phantom.geometry();
  constexpr std::uint8_t kNear = 2;
  std::vector<std::uint8_t> mask(static_cast<std::size_t>(geometry.voxel_count()));
  for (const VesselBranch& branch : phantom.vessel_branches())
    for (const VesselPoint& point : branch.points) {
      // A round cross-section becomes an ellipse, by less than this; and half the way to the next point.
      constexpr double kStretch = 1.8, kStep_mm = 2;
      const double reach_mm = kStretch * point.radius_mm + kStep_mm;
      for_voxels(geometry, point.position_mm - reach_mm, point.position_mm + reach_mm,
                 [&](const Index3&, std::size_t i) { mask[i] = kNear; });
    }
  const VesselTree rest(phantom.resting_branches(), phantom.name());
  parallel_for(geometry.size.z, [&](std::int64_t z) {
    const auto first = static_cast<std::size_t>(z * geometry.slice_voxels());
    for (std::int64_t y = 0; y < geometry.size.y; ++y)
      for (std::int64_t x = 0; x < geometry.size.x; ++x) {
        std::uint8_t& voxel = mask[first + static_cast<std::size_t>(y * geometry.size.x + x)];
        if (voxel == kNear)
          voxel = rest.inside(phantom.motion().pulled_back_mm(geometry.to_world_mm({x, y, z})));
      }
  });
  return mask;
}

}  // namespace

Phantom::Phantom(std::string name, const VolumeGeometry& geometry, std::shared_ptr<const PhantomScene> scene,
                 std::vector<VesselBranch> vessels, std::vector<PhantomPart> parts, double noise_hu,
                 std::uint32_t seed, std::vector<PhantomMode> modes, PhantomMotion motion)
    : name_(std::move(name)),
      geometry_(geometry),
      scene_(std::move(scene)),
      resting_vessels_(std::move(vessels)),
      vessels_(moved(resting_vessels_, motion)),
      parts_(std::move(parts)),
      noise_hu_(noise_hu),
      seed_(seed),
      modes_(std::move(modes)),
      motion_(std::move(motion)) {}

double Phantom::edge_mm() const {
  const glm::dvec3& spacing = geometry_.spacing_mm;
  return std::cbrt(spacing.x * spacing.y * spacing.z);
}

double Phantom::hu_at(const glm::dvec3& world_mm) const {
  return scene_->hu_at(motion_.pulled_back_mm(world_mm), edge_mm());
}

std::vector<std::string> phantom_names() {
  std::vector<std::string> names;
  for (const Kind& kind : kKinds) names.emplace_back(kind.name);
  return names;
}

Phantom make_phantom(const std::string& name, const PhantomOptions& options) {
  const Kind& kind = parse_kind(name);
  const double noise_hu = options.noise_hu.value_or(kind.noise_hu);
  if (!std::isfinite(noise_hu) || noise_hu < 0)
    throw InputError("phantom {}: noise of {} HU must be finite and not negative", name, noise_hu);
  if (options.coronaries && name != "thorax")
    throw InputError("`coronaries`: the phantom {} has none; make thorax", name);
  if (const auto& hu = options.hip_prosthesis_hu) {
    constexpr double kLeast = 3100, kMost = 30000;  // noise stays below what voxels hold
    if (name != "thorax") throw InputError("`hip_prosthesis`: the phantom {} has none; make thorax", name);
    if (!(*hu >= kLeast && *hu <= kMost))
      throw InputError("`hip_prosthesis` {:g}: must be {:g} to {:g} HU", *hu, kLeast, kMost);
  }
  const VolumeGeometry geometry = geometry_of(kind, options);
  PhantomBody body = kind.make(options);
  PhantomMotion motion(body.modes, phases_of(body.modes, options.phase, name));
  return {name,
          geometry,
          std::make_shared<const PhantomScene>(std::move(body.scene)),
          std::move(body.vessels),
          std::move(body.parts),
          noise_hu,
          options.seed,
          std::move(body.modes),
          std::move(motion)};
}

std::vector<std::uint8_t> vessel_mask(const Phantom& phantom) {
  if (!phantom.motion().is_still()) return moved_vessel_mask(phantom);
  const VolumeGeometry& geometry = phantom.geometry();
  std::vector<std::uint8_t> mask(static_cast<std::size_t>(geometry.voxel_count()));
  const auto mark = [&](const VesselPoint& a, const VesselPoint& b) {
    const glm::dvec3 ab = b.position_mm - a.position_mm;
    for_voxels(geometry, glm::min(a.position_mm - a.radius_mm, b.position_mm - b.radius_mm),
               glm::max(a.position_mm + a.radius_mm, b.position_mm + b.radius_mm),
               [&](const Index3& voxel, std::size_t i) {
                 const glm::dvec3 ap = geometry.to_world_mm(voxel) - a.position_mm;
                 const double t = std::clamp(glm::dot(ap, ab) / glm::dot(ab, ab), 0.0, 1.0);
                 if (glm::length(ap - t * ab) <= glm::mix(a.radius_mm, b.radius_mm, t)) mask[i] = 1;
               });
  };
  for (const VesselBranch& branch : phantom.vessel_branches())
    for (std::size_t i = 1; i < branch.points.size(); ++i) mark(branch.points[i - 1], branch.points[i]);
  return mask;
}

std::vector<std::uint8_t> part_mask(const Phantom& phantom, const std::string& part, ComputeDevice& device,
                                    Progress& progress) {
  constexpr double kWhole = 1000;
  const Phantom indicator(phantom.name(), phantom.geometry(),
                          std::make_shared<const PhantomScene>(phantom.scene().indicator(part, kWhole)), {},
                          {}, 0, 0, {}, phantom.motion());
  const Volume share = generate(indicator, device, progress);
  std::vector<std::uint8_t> mask(share.hu().size());
  std::ranges::transform(share.hu(), mask.begin(),
                         [](std::int16_t value) { return static_cast<std::uint8_t>(2 * value >= kWhole); });
  return mask;
}

}  // namespace xraycast
