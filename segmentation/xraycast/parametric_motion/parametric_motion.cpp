#include "xraycast/parametric_motion/parametric_motion.hpp"

#include "xraycast/attenuation/materials.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/motion/breath_model.hpp"
#include "xraycast/motion/heartbeat_model.hpp"
#include "xraycast/parametric_motion/chest_landmarks.hpp"
#include "xraycast/scan/scan.hpp"
#include "xraycast/segmentation/threshold.hpp"

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <cmath>

namespace xraycast {
namespace {

/// Nodes that enclose a box.
VolumeGeometry nodes_around(const glm::dvec3& lower_mm, const glm::dvec3& upper_mm, double spacing_mm) {
  const Index3 steps(glm::ceil((upper_mm - lower_mm) / spacing_mm));
  return {glm::max(steps, Index3(1)) + Index3(1), glm::dvec3(spacing_mm), lower_mm};
}

template <typename Displacement>
std::vector<glm::vec3> sampled(const VolumeGeometry& nodes, Displacement displacement_mm) {
  std::vector<glm::vec3> field_mm(static_cast<std::size_t>(nodes.voxel_count()));
  parallel_for(nodes.size.z, [&](std::int64_t z) {
    auto out = field_mm.begin() + z * nodes.slice_voxels();
    for (std::int64_t y = 0; y < nodes.size.y; ++y)
      for (std::int64_t x = 0; x < nodes.size.x; ++x)
        *out++ = glm::vec3(displacement_mm(nodes.to_world_mm({x, y, z})));
  });
  return field_mm;
}

heartbeat_model::Heart heart_in(const Volume& volume, const ParametricMotionRequest& request,
                                const ChestLandmarks& chest, Progress& progress) {
  if (request.heart_mask.empty()) return chest.found_heart();
  const std::string file = request.heart_mask.string();
  const Scan mask = open_scan(file, {}, progress);
  check_mask_grid(mask.source->geometry(), volume.geometry(), "`heart_mask` " + file);
  return heart_of(between(collect(*mask.source, progress, file), 1, kMaxHu));
}

ScaledMode breath(const VolumeGeometry& scan, const ParametricMotionRequest& request,
                  const ChestLandmarks& chest, const heartbeat_model::Heart& heart) {
  ScaledMode mode{"breath", breath_model::kPeriod_s, breath_model::waveform(), {{0, 0}, {1, 1}}};
  mode.nodes = nodes_around(scan.lower_mm(), scan.upper_mm(), request.spacing_mm);
  const double lung_mm = chest.apices_mm() - chest.dome_mm(), excursion_mm = *request.breath_mm;
  const glm::dvec3 middle = heart.apex_mm - 0.5 * heart.length_mm * heart.axis;
  const double size = heart.radius_mm / heartbeat_model::Heart::kRadius_mm;
  mode.field_mm = sampled(mode.nodes, [&](const glm::dvec3& x) -> glm::dvec3 {
    constexpr double kBelow_mm = -71, kHeart_mm = -21, kHalfX_mm = 55, kHalfY_mm = 50, kHinge_mm = 20;
    const double height = breath_model::model_height_mm(x.z - chest.dome_mm(), lung_mm);
    const double hinge = chest.spine_mm(x.z).y - kHinge_mm, front = chest.front_mm(x.z);
    const double forwards_mm =
        breath_model::forwards_share((hinge - x.y) / std::max(hinge - front, 1.0)) *
        breath_model::wall_mm(height) * excursion_mm / breath_model::kDiaphragm_mm *
        (1 - glm::smoothstep(1.05, 1.6, std::abs(x.x - chest.spine_mm(x.z).x) / chest.half_width_mm()));
    const double mediastinum = glm::smoothstep(kBelow_mm, kHeart_mm, height) *
                               (1 - glm::smoothstep(0.7, 1.3,
                                                    std::hypot((x.x - middle.x) / (size * kHalfX_mm),
                                                               (x.y - middle.y) / (size * kHalfY_mm))));
    const double share =
        glm::mix(breath_model::organ_share(height), breath_model::mediastinal_share(height), mediastinum);
    return {0, forwards_mm, share == 0 ? 0 : chest.freedom(x) * share * excursion_mm};
  });
  return mode;
}

ScaledMode heartbeat(const ParametricMotionRequest& request, const ChestLandmarks& chest,
                     const heartbeat_model::Heart& heart) {
  ScaledMode mode{"heart", heartbeat_model::kPeriod_s};
  for (const double phase : heartbeat_model::keys())
    mode.keys.emplace_back(phase, heartbeat_model::contraction(phase));
  const heartbeat_model::Reach reach = heartbeat_model::reach_of(heart);
  const glm::dvec3 low = heart.apex_mm - reach.lowest_mm * heart.axis,
                   high = heart.apex_mm - reach.highest_mm * heart.axis;
  // A cylinder reaches this far along each axis beyond its middle line's ends; and a node more.
  const glm::dvec3 aside =
      reach.aside_mm * glm::sqrt(glm::dvec3(1) - heart.axis * heart.axis) + request.spacing_mm;
  mode.nodes = nodes_around(glm::min(low, high) - aside, glm::max(low, high) + aside, request.spacing_mm);
  mode.field_mm = sampled(mode.nodes, [&](const glm::dvec3& x) {
    const glm::dvec3 free_mm = heartbeat_model::systole_mm(heart, x);
    return free_mm == glm::dvec3(0) ? free_mm : chest.freedom(x) * free_mm;
  });
  return mode;
}

}  // namespace

void check(const ParametricMotionRequest& request) {
  if (!request.breath_mm && !request.heart) {
    if (!request.heart_mask.empty()) throw InputError("`heart_mask` is that of a beating heart; add `heart`");
    throw InputError("a motion needs a movement; give `breath_mm`, `heart` or both");
  }
  if (request.breath_mm && !(*request.breath_mm >= 1 && *request.breath_mm <= 40))
    throw InputError("`breath_mm` {}: must be 1 to 40 mm; a quiet breath is 12", *request.breath_mm);
  if (!(request.spacing_mm >= 1 && request.spacing_mm <= 20))
    throw InputError("`spacing_mm` {}: must be 1 to 20 mm", request.spacing_mm);
}

ParametricMotion parametric_motion(const Volume& volume, const ParametricMotionRequest& request,
                                   const std::string& name, Progress& progress) {
  check(request);
  const CancelScope scope(progress);
  const VolumeGeometry& scan = volume.geometry();
  constexpr std::int64_t kMostNodes = (std::int64_t{2} << 30) / std::int64_t{sizeof(glm::vec3)};
  if (nodes_around(scan.lower_mm(), scan.upper_mm(), request.spacing_mm).voxel_count() > kMostNodes)
    throw InputError("`spacing_mm` {}: the fields would be too large; choose a larger spacing",
                     request.spacing_mm);
  progress.begin("finding lungs and heart", 1, "chests");
  const ChestLandmarks chest(volume, name);
  const heartbeat_model::Heart heart = heart_in(volume, request, chest, progress);
  progress.advance();

  ParametricMotion motion;
  const glm::dvec3 middle = heart.apex_mm - 0.5 * heart.length_mm * heart.axis;
  motion.notes.push_back(
      fmt::format("{}: the right dome of the diaphragm lies at z = {:.0f} mm, the lungs "
                  "reach {:.0f} mm above it",
                  name, chest.dome_mm(), chest.apices_mm() - chest.dome_mm()));
  motion.notes.push_back(fmt::format(
      "{}: the heart's middle lies at {:.0f}, {:.0f}, {:.0f} mm, its radius is {:.0f} mm{}", name, middle.x,
      middle.y, middle.z, heart.radius_mm, request.heart_mask.empty() ? ", by the shape of the chest" : ""));
  progress.begin("displacing", 2, "modes");
  if (request.breath_mm) motion.modes.push_back(breath(scan, request, chest, heart));
  progress.advance();
  if (request.heart) motion.modes.push_back(heartbeat(request, chest, heart));
  progress.advance();
  return motion;
}

}  // namespace xraycast
