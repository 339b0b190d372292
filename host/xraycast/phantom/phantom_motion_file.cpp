#include "xraycast/phantom/phantom_motion_file.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/motion/motion_writer.hpp"

#include <glm/common.hpp>

#include <vector>

namespace xraycast {
namespace {

/// The nodes that enclose where a mode moves what is in the phantom, on a lattice through the world's origin.
VolumeGeometry nodes_of(const PhantomMode& mode, const VolumeGeometry& phantom, double spacing_mm) {
  const glm::dvec3 lower = glm::floor(glm::max(mode.lower_mm, phantom.lower_mm()) / spacing_mm);
  const glm::dvec3 upper = glm::ceil(glm::min(mode.upper_mm, phantom.upper_mm()) / spacing_mm);
  return {glm::max(Index3(upper - lower) + Index3(1), Index3(2)), glm::dvec3(spacing_mm), spacing_mm * lower};
}

std::vector<glm::vec3> displacements(const PhantomMode& mode, const VolumeGeometry& nodes) {
  std::vector<glm::vec3> whole_mm(static_cast<std::size_t>(nodes.voxel_count()));
  parallel_for(nodes.size.z, [&](std::int64_t z) {
    auto out = whole_mm.begin() + z * nodes.slice_voxels();
    for (std::int64_t y = 0; y < nodes.size.y; ++y)
      for (std::int64_t x = 0; x < nodes.size.x; ++x)
        *out++ = glm::vec3(mode.displacement_mm(nodes.to_world_mm({x, y, z})));
  });
  return whole_mm;
}

}  // namespace

void check_motion(const Phantom& phantom, double spacing_mm) {
  if (phantom.modes().empty())
    throw InputError("`motion`: the phantom {} does not move; make thorax or head", phantom.name());
  if (!phantom.motion().is_still())
    throw InputError("`motion` is that of the phantom at rest; leave `phase` out");
  if (!(spacing_mm >= 0.5 && spacing_mm <= 50))
    throw InputError("`motion_spacing_mm` {}: must be 0.5 to 50 mm", spacing_mm);
  constexpr std::int64_t kMost_B = std::int64_t{2} << 30;
  for (const PhantomMode& mode : phantom.modes())
    if (nodes_of(mode, phantom.geometry(), spacing_mm).voxel_count() >
        kMost_B / std::int64_t{sizeof(glm::vec3)})
      throw InputError("`motion_spacing_mm` {}: the fields would be too large; choose a larger spacing",
                       spacing_mm);
}

void write_motion(const Phantom& phantom, const std::filesystem::path& folder, double spacing_mm,
                  Progress& progress) {
  check_motion(phantom, spacing_mm);
  std::vector<ScaledMode> modes;
  for (const PhantomMode& mode : phantom.modes()) {
    ScaledMode& scaled = modes.emplace_back(ScaledMode{mode.name, mode.period_s, mode.waveform});
    for (const double phase : mode.keys) scaled.keys.emplace_back(phase, mode.share(phase));
    scaled.nodes = nodes_of(mode, phantom.geometry(), spacing_mm);
    scaled.field_mm = displacements(mode, scaled.nodes);
  }
  write_motion(modes, folder, progress);
}

}  // namespace xraycast
