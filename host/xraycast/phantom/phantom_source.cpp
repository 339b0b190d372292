#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/phantom/phantom.hpp"
#include "xraycast/phantom/phantom_scene.hpp"

#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

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

/// What the voxels of each brick of a slab show: a box around their places, in `rows` of `columns`.
struct BrickPlaces {
  std::int64_t columns, rows;
  std::vector<PhantomScene::Box> boxes;
};

/// Of voxels that show what is there.
BrickPlaces resting_places(const VolumeGeometry& geometry, std::int64_t first_slice, std::int64_t count) {
  BrickPlaces places{bricks_for(geometry.size.x), bricks_for(geometry.size.y), {}};
  const glm::dvec3 origin = geometry.to_world_mm({0, 0, first_slice});
  const glm::dvec3 brick_mm = geometry.spacing_mm * glm::dvec3(kBrick, kBrick, count);
  for (std::int64_t y = 0; y < places.rows; ++y)
    for (std::int64_t x = 0; x < places.columns; ++x) {
      const glm::dvec3 corner = origin + brick_mm * glm::dvec3(x, y, 0);
      places.boxes.push_back({corner, corner + brick_mm});
    }
  return places;
}

BrickLists list_bricks(const Phantom& phantom, const BrickPlaces& places) {
  const PhantomScene& scene = phantom.scene();
  const double edge = phantom.edge_mm();
  std::vector<float> base_hu(places.boxes.size(), static_cast<float>(scene.background_hu()));
  std::vector<std::vector<cl_int>> lists(base_hu.size());
  parallel_for(places.rows, [&](std::int64_t row) {
    const auto begin = static_cast<std::size_t>(row * places.columns);
    const std::size_t end = begin + static_cast<std::size_t>(places.columns);
    glm::dvec3 lower = places.boxes[begin].lower_mm, upper = places.boxes[begin].upper_mm;
    for (std::size_t brick = begin; brick < end; ++brick) {
      lower = glm::min(lower, places.boxes[brick].lower_mm);
      upper = glm::max(upper, places.boxes[brick].upper_mm);
    }
    const auto reaches = [&](const XrcPrimitive& shape, const glm::dvec3& from, const glm::dvec3& to) {
      return glm::all(glm::lessThanEqual(corner(shape.lower_mm) - edge, to)) &&
             glm::all(glm::greaterThanEqual(corner(shape.upper_mm) + edge, from));
    };
    for (std::size_t i = 0; i < scene.primitives().size(); ++i) {
      const XrcPrimitive& shape = scene.primitives()[i];
      if (!reaches(shape, lower, upper)) continue;
      for (std::size_t brick = begin; brick < end; ++brick) {
        const PhantomScene::Box& box = places.boxes[brick];
        if (!reaches(shape, box.lower_mm, box.upper_mm)) continue;
        if (scene.covers(shape, box, edge)) {
          base_hu[brick] = shape.hu;
          lists[brick].clear();
        } else {
          lists[brick].push_back(static_cast<cl_int>(i));
        }
      }
    }
  });

  BrickLists result{std::move(base_hu), {0}, {}};
  for (const auto& list : lists) {
    result.list.insert(result.list.end(), list.begin(), list.end());
    result.first.push_back(static_cast<cl_int>(result.list.size()));
  }
  return result;
}

/// Of voxels of a moved body. `places_mm` receives the place of each voxel for the kernel: of each row of a
/// brick 16 x, 16 y and 16 z.
BrickPlaces moved_places(const Phantom& phantom, std::int64_t first_slice, std::int64_t count,
                         std::vector<float>& places_mm) {
  const VolumeGeometry& geometry = phantom.geometry();
  BrickPlaces places{bricks_for(geometry.size.x), bricks_for(geometry.size.y), {}};
  places.boxes.resize(static_cast<std::size_t>(places.columns * places.rows));
  places_mm.resize(static_cast<std::size_t>(count * geometry.size.y * places.columns * 3 * kBrick));
  parallel_for(places.columns * places.rows, [&](std::int64_t brick) {
    const std::int64_t column = brick % places.columns, first_row = brick / places.columns * kBrick;
    constexpr double kNowhere = std::numeric_limits<double>::infinity();
    PhantomScene::Box box{glm::dvec3(kNowhere), glm::dvec3(-kNowhere)};
    for (std::int64_t z = 0; z < count; ++z)
      for (std::int64_t y = first_row; y < std::min(first_row + kBrick, geometry.size.y); ++y) {
        float* const row = &places_mm[static_cast<std::size_t>(
            ((z * geometry.size.y + y) * places.columns + column) * 3 * kBrick)];
        for (std::int64_t x = 0; x < kBrick; ++x) {
          const glm::dvec3 place = phantom.motion().pulled_back_mm(
              geometry.to_world_mm({column * kBrick + x, y, first_slice + z}));
          box = {glm::min(box.lower_mm, place), glm::max(box.upper_mm, place)};
          for (int axis = 0; axis < 3; ++axis) row[axis * kBrick + x] = static_cast<float>(place[axis]);
        }
      }
    // The kernel's places are rounded.
    constexpr double kRounding_mm = 1e-3;
    places.boxes[static_cast<std::size_t>(brick)] = {box.lower_mm - kRounding_mm,
                                                     box.upper_mm + kRounding_mm};
  });
  return places;
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
      kernel_(device.kernel("phantom", phantom.motion().is_still() ? "phantom_slab" : "phantom_slab_moved")),
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

  const bool is_still = phantom_.motion().is_still();
  std::vector<float> places_mm;
  const BrickLists bricks = list_bricks(phantom_, is_still ? resting_places(geometry, next_, count)
                                                           : moved_places(phantom_, next_, count, places_mm));
  const auto bytes = static_cast<std::int64_t>(slices.size_bytes());
  try {
    const cl::Buffer base_hu = constant_buffer<float>(device_, bricks.base_hu);
    const cl::Buffer first = constant_buffer<cl_int>(device_, bricks.first);
    const cl::Buffer list = constant_buffer<cl_int>(device_, bricks.list);
    const cl::Buffer places = constant_buffer<float>(device_, places_mm);
    const cl::Buffer out = device_.buffer(CL_MEM_WRITE_ONLY, bytes);
    if (is_still)
      set_args(kernel_, slab, primitives_, stations_, base_hu, first, list, out);
    else
      set_args(kernel_, slab, primitives_, stations_, base_hu, first, list, places, out);
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
  // A slab at a time, so that progress is visible and device memory stays small. A moved one has 12 bytes of
  // places a voxel, too.
  constexpr std::int64_t kPlaces_B = 256 << 20;
  const std::int64_t slab =
      phantom_.motion().is_still() ? kBrick : std::clamp<std::int64_t>(kPlaces_B / (12 * slice), 1, kBrick);
  for (std::int64_t done = 0; done < wanted;) {
    const std::int64_t count = std::min(slab, wanted - done);
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
