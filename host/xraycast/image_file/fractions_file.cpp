#include "xraycast/image_file/fractions_file.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/image_file/image_file_stack.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace xraycast {

Fractions read_fractions(const std::filesystem::path& path) {
  const ImageFile file = read_nrrd(path);
  const ImageHeader& header = file.header;
  const auto* packed = std::get_if<PackedVoxels>(&file.voxels);
  const auto& [i, j, k] = header.step_mm;
  const bool is_aligned = i.x > 0 && j.y > 0 && k.z > 0 && i == glm::dvec3(i.x, 0, 0) &&
                          j == glm::dvec3(0, j.y, 0) && k == glm::dvec3(0, 0, k.z);
  if (packed == nullptr || header.type != VoxelType::float32 || header.size.size() != 3 ||
      header.numbers_per_voxel != 1 || header.is_big_endian == (std::endian::native == std::endian::little) ||
      !is_aligned)
    throw InputError("{}: is not a file of fractions that `xraycast segment` wrote; delete it",
                     path.string());
  Fractions fractions{{{header.size[0], header.size[1], header.size[2]}, {i.x, j.y, k.z}, header.origin_mm},
                      {}};
  validate(fractions.geometry, path.string());
  const std::int64_t count = fractions.geometry.voxel_count(), needed_B = count * std::int64_t{sizeof(float)};
  require_packed(*packed, needed_B);
  const std::unique_ptr<char[]> bytes = inflate_voxels(*packed, needed_B);
  fractions.values.resize(static_cast<std::size_t>(count));
  for (std::size_t at = 0; at < fractions.values.size(); ++at) {
    float value = 0;
    std::memcpy(&value, bytes.get() + at * sizeof(float), sizeof(float));
    if (!(value >= 0 && value <= 1))
      throw InputError("{}: a fraction is {:g}, not 0 to 1", path.string(), value);
    fractions.values[at] = static_cast<std::uint8_t>(std::lround(255 * value));
  }
  return fractions;
}

}  // namespace xraycast
