#include "xraycast/base/error.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/phantom/phantom_scene.hpp"

#include <glm/common.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

static_assert(sizeof(XrcPhantomSlab) == 14 * 4);

constexpr std::int64_t kBrick = XRC_PHANTOM_BRICK;

/// The shapes that matter in each brick of a slab: far fewer than all of them, and none in most.
struct BrickLists {
  std::vector<float> base_hu;
  std::vector<cl_int> first;  ///< one more than bricks
  std::vector<cl_int> list;
};

glm::dvec3 corner(const float (&v)[3]) { return {v[0], v[1], v[2]}; }

std::int64_t bricks_for(std::int64_t voxels) { return (voxels + kBrick - 1) / kBrick; }

BrickLists list_bricks(const Phantom& phantom, std::int64_t first_slice, std::int64_t count) {
  const VolumeGeometry& geometry = phantom.geometry();
  const PhantomScene& scene = phantom.scene();
  const double edge = phantom.edge_mm();
  const std::int64_t columns = bricks_for(geometry.size.x), rows = bricks_for(geometry.size.y);
  const glm::dvec3 origin = geometry.to_world_mm({0, 0, first_slice});
  const glm::dvec3 brick_mm = geometry.spacing_mm * glm::dvec3(kBrick, kBrick, count);

  std::vector<float> base_hu(static_cast<std::size_t>(columns * rows),
                             static_cast<float>(scene.background_hu()));
  std::vector<std::vector<cl_int>> lists(base_hu.size());
  for (std::size_t i = 0; i < scene.primitives().size(); ++i) {
    const XrcPrimitive& shape = scene.primitives()[i];
    const glm::dvec3 lower = glm::floor((corner(shape.lower_mm) - edge - origin) / brick_mm);
    const glm::dvec3 upper = glm::floor((corner(shape.upper_mm) + edge - origin) / brick_mm);
    if (lower.z > 0 || upper.z < 0) continue;
    const auto within = [](double index, std::int64_t bricks) {
      return static_cast<std::int64_t>(std::clamp(index, -1.0, static_cast<double>(bricks)));
    };
    for (std::int64_t y = std::max<std::int64_t>(within(lower.y, rows), 0);
         y <= std::min(within(upper.y, rows), rows - 1); ++y)
      for (std::int64_t x = std::max<std::int64_t>(within(lower.x, columns), 0);
           x <= std::min(within(upper.x, columns), columns - 1); ++x) {
        const auto brick = static_cast<std::size_t>(y * columns + x);
        const glm::dvec3 corner = origin + brick_mm * glm::dvec3(x, y, 0);
        if (scene.covers(shape, {corner, corner + brick_mm}, edge)) {
          base_hu[brick] = shape.hu;
          lists[brick].clear();
        } else {
          lists[brick].push_back(static_cast<cl_int>(i));
        }
      }
  }

  BrickLists result{std::move(base_hu), {0}, {}};
  for (const auto& list : lists) {
    result.list.insert(result.list.end(), list.begin(), list.end());
    result.first.push_back(static_cast<cl_int>(result.list.size()));
  }
  return result;
}

template <typename T>
cl::Buffer constant_buffer(ComputeDevice& device, std::span<const T> data) {
  if (data.empty()) return device.buffer(CL_MEM_READ_ONLY, sizeof(T));
  return device.buffer(CL_MEM_READ_ONLY | CL_MEM_COPY_HOST_PTR, static_cast<std::int64_t>(data.size_bytes()),
                       const_cast<T*>(data.data()));
}

}  // namespace

PhantomSource::PhantomSource(const Phantom& phantom, ComputeDevice& device)
    : phantom_(phantom),
      device_(device),
      kernel_(device.kernel("phantom", "phantom_slab")),
      primitives_(constant_buffer(device, phantom.scene().primitives())),
      stations_(constant_buffer(device, phantom.scene().stations())) {}

void PhantomSource::paint(std::span<std::int16_t> slices, std::int64_t count) {
  const VolumeGeometry& geometry = phantom_.geometry();
  XrcPhantomSlab slab{};
  for (int i = 0; i < 3; ++i) {
    slab.size[i] = static_cast<cl_int>(i < 2 ? geometry.size[i] : count);
    slab.origin_mm[i] = static_cast<float>(geometry.origin_mm[i]);
    slab.spacing_mm[i] = static_cast<float>(geometry.spacing_mm[i]);
  }
  slab.bricks_x = static_cast<cl_int>(bricks_for(geometry.size.x));
  slab.first_slice = static_cast<cl_int>(next_);
  slab.edge_mm = static_cast<float>(phantom_.edge_mm());
  slab.noise_hu = static_cast<float>(phantom_.noise_hu());
  slab.seed = static_cast<cl_int>(phantom_.seed());

  const BrickLists bricks = list_bricks(phantom_, next_, count);
  const auto bytes = static_cast<std::int64_t>(slices.size_bytes());
  try {
    const cl::Buffer base_hu = constant_buffer<float>(device_, bricks.base_hu);
    const cl::Buffer first = constant_buffer<cl_int>(device_, bricks.first);
    const cl::Buffer list = constant_buffer<cl_int>(device_, bricks.list);
    const cl::Buffer out = device_.buffer(CL_MEM_WRITE_ONLY, bytes);
    set_args(kernel_, slab, primitives_, stations_, base_hu, first, list, out);
    // A work-group is a brick: its rows run through the same list.
    const cl::NDRange range(static_cast<cl::size_type>(slab.bricks_x),
                            static_cast<cl::size_type>(bricks_for(geometry.size.y) * kBrick),
                            static_cast<cl::size_type>(count));
    device_.queue().enqueueNDRangeKernel(kernel_, cl::NullRange, range, cl::NDRange(1, kBrick, 1));
    device_.queue().enqueueReadBuffer(out, CL_TRUE, 0, static_cast<cl::size_type>(bytes), slices.data());
  } catch (const cl::Error& error) {
    throw DeviceError("phantom {} could not be generated: {} failed with {}", phantom_.name(), error.what(),
                      status_name(error.err()));
  }
}

std::int64_t PhantomSource::read(std::span<std::int16_t> hu, Progress& progress) {
  const std::int64_t slice = geometry().slice_voxels();
  const std::int64_t wanted =
      std::min(static_cast<std::int64_t>(hu.size()) / slice, geometry().size.z - next_);
  // A slab at a time, so that progress is visible and device memory stays small.
  for (std::int64_t done = 0; done < wanted;) {
    const std::int64_t count = std::min(kBrick, wanted - done);
    const auto slices =
        hu.subspan(static_cast<std::size_t>(done * slice), static_cast<std::size_t>(count * slice));
    paint(slices, count);
    const auto [low, high] = std::ranges::minmax_element(slices);
    if (next_ == 0) range_ = {static_cast<double>(*low), static_cast<double>(*high)};
    range_ = {std::min<double>(range_.lowest, *low), std::max<double>(range_.highest, *high)};
    done += count;
    next_ += count;
    progress.advance(count);
  }
  return std::max<std::int64_t>(wanted, 0);
}

Volume generate(const Phantom& phantom, ComputeDevice& device, Progress& progress) {
  Volume volume(phantom.geometry(), "phantom " + phantom.name());
  PhantomSource source(phantom, device);
  progress.begin("painting", phantom.geometry().size.z, "slices");
  source.read(volume.hu(), progress);
  return volume;
}

}  // namespace xraycast
