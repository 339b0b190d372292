#include "xraycast/evidence/block_filter.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"

#include <glm/common.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace xraycast {
namespace {

cl_int4 int4_of(const Index3& i) {
  return {{static_cast<cl_int>(i.x), static_cast<cl_int>(i.y), static_cast<cl_int>(i.z), 0}};
}

/// The kernels count voxels with int.
void require_indices(const Index3& size) {
  constexpr std::int64_t kMost = std::numeric_limits<cl_int>::max();
  if (size.x > kMost || size.y > kMost / size.x || size.z > kMost / (size.x * size.y))
    throw InputError(
        "a block of {} x {} x {} voxels is too large to filter; at most {} voxels fit: give a part of "
        "the scan, or resample it to larger voxels",
        size.x, size.y, size.z, kMost);
}

/// Weights of a Gaussian at 0, 1, 2 … `reach` voxels; both sides add up to 1.
std::vector<float> gaussian_weights(double sigma_vox, int reach) {
  std::vector<double> weights;
  double sum = 0;
  for (int k = 0; k <= reach; ++k) {
    weights.push_back(std::exp(-0.5 * k * k / (sigma_vox * sigma_vox)));
    sum += (k == 0 ? 1 : 2) * weights.back();
  }
  std::vector<float> result;
  for (const double weight : weights) result.push_back(static_cast<float>(weight / sum));
  return result;
}

/// Directions spread evenly over a half sphere, by the golden angle.
std::vector<glm::dvec3> spread_directions(int count) {
  std::vector<glm::dvec3> directions;
  for (int i = 0; i < count; ++i) {
    const double z = (i + 0.5) / count, r = std::sqrt(1 - z * z),
                 phi = i * std::numbers::pi * (1 + std::sqrt(5.0));
    directions.emplace_back(r * std::cos(phi), r * std::sin(phi), z);
  }
  return directions;
}

/// The steps of lines from a voxel: the corner before each, and where it lies between corners.
struct LineSteps {
  std::vector<cl_int4> corners;
  std::vector<cl_float4> fractions;

  void add(const glm::dvec3& step) {
    const glm::dvec3 corner = glm::floor(step), fraction = step - corner;
    corners.push_back(int4_of(Index3(corner)));
    fractions.push_back({{static_cast<float>(fraction.x), static_cast<float>(fraction.y),
                          static_cast<float>(fraction.z), 0}});
  }
};

/// Of each direction one arm, then the other.
LineSteps steps_of(const std::vector<glm::dvec3>& directions, int reach) {
  LineSteps steps;
  for (const glm::dvec3& direction : directions)
    for (const double sign : {1.0, -1.0})
      for (int k = 1; k <= reach; ++k) steps.add(sign * k * direction);
  return steps;
}

}  // namespace

BlockFilter::BlockFilter(ComputeDevice& device, const Index3& size) : device_(device), size_(size) {
  require_indices(size);
}

cl::Buffer BlockFilter::block() {
  return device_.buffer(CL_MEM_READ_WRITE, static_cast<std::int64_t>(voxel_count() * sizeof(float)));
}

cl::Buffer BlockFilter::upload(std::span<const float> values) {
  return device_.upload(values, CL_MEM_READ_WRITE);
}

std::vector<float> BlockFilter::download(const cl::Buffer& values) {
  std::vector<float> result(voxel_count());
  device_.download(values, std::span(result));
  return result;
}

template <typename... Arguments>
void BlockFilter::run(const char* name, const Index3& items, const cl::Buffer& source,
                      const cl::Buffer& target, const Arguments&... arguments) {
  cl::Kernel kernel = device_.kernel("vesselness", name);
  set_args(kernel, source, target, int4_of(size_), arguments...);
  constexpr std::int64_t kSlices =
      4;  // of 512 x 512 voxels, less than a second each: they cannot be cancelled
  for (std::int64_t first = 0; first < items.z; first += kSlices) {
    check_cancelled();
    device_.run(kernel, {items.x, items.y, std::min(kSlices, items.z - first)}, {}, {0, 0, first});
    device_.finish();
  }
}

Index3 BlockFilter::eight_a_work_item() const { return {(size_.x + 7) / 8, size_.y, size_.z}; }

cl::Buffer BlockFilter::smooth(const cl::Buffer& values, const glm::dvec3& sigma_vox) {
  cl::Buffer source = values;
  for (int axis = 0; axis < 3; ++axis) {
    const int reach = std::max(1, static_cast<int>(std::ceil(3 * sigma_vox[axis])));
    const std::vector<float> weights = gaussian_weights(sigma_vox[axis], reach);
    const cl::Buffer device_weights = device_.upload(std::span(weights)), target = block();
    run("gaussian", eight_a_work_item(), source, target, axis, device_weights, static_cast<cl_int>(reach));
    source = target;
  }
  return source;
}

void BlockFilter::add_tubularity(const cl::Buffer& smoothed, const glm::dvec3& spacing_mm, double scale_mm,
                                 double strength, bool is_frangi, const cl::Buffer& best) {
  const glm::dvec3 s = spacing_mm;
  const double scale2 = scale_mm * scale_mm;
  const std::vector<float> per_mm2 = {
      static_cast<float>(scale2 / (s.x * s.x)), static_cast<float>(scale2 / (s.y * s.y)),
      static_cast<float>(scale2 / (s.z * s.z)), static_cast<float>(scale2 / (s.x * s.y)),
      static_cast<float>(scale2 / (s.x * s.z)), static_cast<float>(scale2 / (s.y * s.z))};
  const cl::Buffer device_per_mm2 = device_.upload(std::span(per_mm2));
  run("tubularity", size_, smoothed, best, device_per_mm2, static_cast<cl_float>(strength),
      static_cast<cl_int>(is_frangi));
}

cl::Buffer BlockFilter::ridge_strength(const cl::Buffer& values, double sigma_vox, int reach_vox,
                                       int directions, double least) {
  const std::vector<float> weights = gaussian_weights(sigma_vox, reach_vox);
  const LineSteps steps = steps_of(spread_directions(directions), reach_vox);
  const cl::Buffer device_weights = device_.upload(std::span(weights)),
                   corners = device_.upload(std::span(steps.corners)),
                   fractions = device_.upload(std::span(steps.fractions));
  const int margin = reach_vox + 1;
  const Index3 items = eight_a_work_item(),
               padded = Index3(8 * items.x, size_.y, size_.z) + Index3(2 * margin);
  require_indices(padded);
  const cl::Buffer wide = device_.buffer(
      CL_MEM_READ_WRITE, padded.x * padded.y * padded.z * static_cast<std::int64_t>(sizeof(float)));
  cl::Buffer target = block();
  run("with_margin", padded, values, wide, int4_of(padded), static_cast<cl_int>(margin));
  run("ridge_strength", items, wide, target, int4_of(padded), corners, fractions,
      static_cast<cl_int>(directions), device_weights, static_cast<cl_int>(reach_vox),
      static_cast<cl_float>(least));
  return target;
}

std::vector<float> filtered(const Volume& volume, ComputeDevice& device, std::int64_t halo,
                            const std::function<cl::Buffer(BlockFilter&, const cl::Buffer&)>& filter,
                            Progress* progress) {
  constexpr std::int64_t kSlabSlices = 64;  // 512 x 512 of them take 80 MB a buffer
  const VolumeGeometry& g = volume.geometry();
  std::vector<float> result;
  result.reserve(static_cast<std::size_t>(g.voxel_count()));
  for (std::int64_t first = 0; first < g.size.z; first += kSlabSlices) {
    const std::int64_t begin = std::max<std::int64_t>(0, first - halo),
                       last = std::min(g.size.z, first + kSlabSlices), end = std::min(g.size.z, last + halo);
    const auto hu = volume.slices(begin, end - begin);
    std::vector<float> values(hu.begin(), hu.end());
    BlockFilter block(device, {g.size.x, g.size.y, end - begin});
    values = block.download(filter(block, block.upload(values)));
    const auto from = values.begin() + (first - begin) * g.slice_voxels();
    result.insert(result.end(), from, from + (last - first) * g.slice_voxels());
    if (progress != nullptr) progress->advance(last - first);
  }
  return result;
}

std::vector<float> smoothed(const Volume& volume, const glm::dvec3& sigma_vox, ComputeDevice& device) {
  const auto halo = static_cast<std::int64_t>(std::ceil(3 * sigma_vox.z));
  return filtered(volume, device, halo, [&](BlockFilter& block, const cl::Buffer& values) {
    return block.smooth(values, sigma_vox);
  });
}

}  // namespace xraycast
