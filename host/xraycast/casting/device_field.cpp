#include "xraycast/casting/device_field.hpp"

#include "xraycast/base/parallel.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace xraycast {

static_assert(sizeof(XrcField) == 20);

FieldNodes::FieldNodes(const VolumeGeometry& volume, double spacing_mm) : scan(volume) {
  int slices = XRC_BRICK_SLICES;
  while (slices > 1 && slices * scan.spacing_mm.z > spacing_mm) slices /= 2;
  const std::int64_t bricks = (scan.size.z + XRC_BRICK_SLICES - 1) / XRC_BRICK_SLICES;
  for (int axis = 0; axis < 2; ++axis) {
    const auto last = static_cast<double>(scan.size[axis] - 1);
    size[axis] = 1 + std::max<std::int64_t>(1, std::llround(last * scan.spacing_mm[axis] / spacing_mm));
    step[axis] = std::max(1.0, last) / static_cast<double>(size[axis] - 1);
  }
  size.z = bricks * XRC_BRICK_SLICES / slices + 1;
  step.z = slices;
}

DeviceField::DeviceField(ComputeDevice& device, const FieldNodes& nodes,
                         std::span<const glm::vec3> displacement_mm)
    : layout_{static_cast<XRC_INT>(nodes.size.x),
              static_cast<XRC_INT>(nodes.size.y),
              static_cast<XRC_INT>(nodes.size.z),
              {static_cast<XRC_FLOAT>(1 / nodes.step.x), static_cast<XRC_FLOAT>(1 / nodes.step.y)}},
      slices_(static_cast<int>(nodes.step.z)) {
  std::vector<std::array<float, 4>> voxels(displacement_mm.size());
  const glm::vec3 per_mm = 1.0 / nodes.scan.spacing_mm;
  parallel_for(nodes.size.z, [&](std::int64_t level) {
    const std::int64_t of_level = nodes.size.x * nodes.size.y;
    for (std::int64_t i = level * of_level; i < (level + 1) * of_level; ++i) {
      const glm::vec3 d = displacement_mm[i] * per_mm;
      voxels[i] = {d.x, d.y, d.z, 0};
    }
  });
  nodes_ = device.upload(std::span<const std::array<float, 4>>(voxels));
}

std::string DeviceField::build_options() const { return fmt::format(" -DMOVED={}", slices_); }

void DeviceField::set_args(cl::Kernel& kernel, unsigned first) const {
  kernel.setArg(first, layout_);
  kernel.setArg(first + 1, nodes_);
}

}  // namespace xraycast
