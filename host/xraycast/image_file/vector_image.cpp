#include "xraycast/image_file/vector_image.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/memory_limit.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/image_file/image_file_scan.hpp"
#include "xraycast/image_file/image_file_stack.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

enum class ImageFormat { none, nrrd, meta_image, nifti };

ImageFormat image_format_of(const fs::path& path) {
  constexpr std::size_t kLeading_B = 1024;
  std::string leading(kLeading_B, '\0');
  std::ifstream stream(path, std::ios::binary);
  stream.read(leading.data(), kLeading_B);
  leading.resize(static_cast<std::size_t>(stream.gcount()));
  if (leading.starts_with("NRRD")) return ImageFormat::nrrd;
  if (is_meta_image(leading)) return ImageFormat::meta_image;
  const bool is_gzipped = leading.starts_with("\x1f\x8b");
  constexpr std::int32_t kSizes[] = {348, 540};
  std::int32_t size = 0;
  if (leading.size() >= sizeof size) std::memcpy(&size, leading.data(), sizeof size);
  const bool is_nifti = std::ranges::any_of(kSizes, [&](std::int32_t known) {
    return size == known ||
           static_cast<std::int32_t>(__builtin_bswap32(static_cast<std::uint32_t>(size))) == known;
  });
  return is_gzipped || is_nifti ? ImageFormat::nifti : ImageFormat::none;
}

ImageFile read_image_file(const fs::path& path) {
  switch (image_format_of(path)) {
    case ImageFormat::nrrd:
      return read_nrrd(path);
    case ImageFormat::meta_image:
      return read_meta_image(path);
    case ImageFormat::nifti:
      return read_nifti(path);
    case ImageFormat::none:
      break;
  }
  throw InputError("{}: no image file; give an NRRD, MetaImage or NIfTI file of vectors", path.string());
}

/// NIfTI has the numbers of a voxel in its fifth dimension.
void take_numbers_of_fifth(ImageHeader& header) {
  if (header.size.size() != 5 || header.size[3] != 1) return;
  header.numbers_per_voxel = header.size[4];
  header.are_numbers_apart = true;
  header.size.resize(3);
}

FieldGrid grid_of(ImageHeader& header) {
  take_numbers_of_fifth(header);
  const std::string name = header.path.string();
  if (header.size.size() != 3)
    throw InputError(
        "{}: {} dimensions of voxels; a field of vectors has three, and in a NIfTI file five, the fourth 1 "
        "and "
        "the last 3: export it as such",
        name, header.size.size());
  if (header.numbers_per_voxel != 3)
    throw InputError("{}: {} per voxel; a field of vectors has three: export it as such", name,
                     header.numbers_per_voxel == 1 ? std::string("one number")
                                                   : fmt::format("{} numbers", header.numbers_per_voxel));
  if (header.has_numbers_between)
    throw InputError("{}: a vector's numbers are stored between the rows; store them first or last", name);
  FieldGrid grid{{header.size[0], header.size[1], header.size[2]}, header.origin_mm, {}};
  for (int axis = 0; axis < 3; ++axis) grid.step_mm[axis] = header.step_mm[static_cast<std::size_t>(axis)];
  validate(grid, name);
  return grid;
}

/// The voxels' bytes, in the order in which they are stored.
class StoredBytes {
 public:
  /// Throws InputError when there are fewer than `needed_B`.
  StoredBytes(const std::string& name, const StoredVoxels& voxels, std::int64_t needed_B) {
    if (const auto* packed = std::get_if<PackedVoxels>(&voxels)) {
      unpacked_ = inflate_voxels(*packed, needed_B);
    } else {
      const auto& plain = std::get<PlainVoxels>(voxels);
      if (plain.files.size() > 1)
        throw InputError("{}: its voxels lie in several files; save them as one", name);
      raw_.emplace(opened(plain, needed_B));
    }
  }

  void read(std::int64_t first_B, std::span<char> bytes) const {
    if (unpacked_)
      std::copy_n(unpacked_.get() + first_B, bytes.size(), bytes.data());
    else
      raw_->read(first_B, bytes);
  }

 private:
  std::unique_ptr<char[]> unpacked_;
  std::optional<RawVoxels> raw_;
};

template <typename Number>
void to_floats(std::span<const char> bytes, double slope, double intercept, std::span<float> floats) {
  for (std::size_t i = 0; i < floats.size(); ++i) {
    Number number;
    std::memcpy(&number, bytes.data() + i * sizeof number, sizeof number);
    floats[i] = static_cast<float>(static_cast<double>(number) * slope + intercept);
  }
}

void to_floats(std::span<const char> bytes, const ImageHeader& header, std::span<float> floats) {
  with_voxel_type(header.type, [&]<typename Number>(Number) {
    to_floats<Number>(bytes, header.slope, header.intercept, floats);
  });
}

/// Numbers `first` to `first + floats.size() - 1` of those that are stored.
void read_numbers(const StoredBytes& stored, const ImageHeader& header, std::int64_t first,
                  std::span<float> floats) {
  const std::int64_t number_B = bytes_of(header.type);
  std::vector<char> bytes(floats.size() * static_cast<std::size_t>(number_B));
  stored.read(first * number_B, bytes);
  if (number_B > 1 && header.is_big_endian == (std::endian::native == std::endian::little))
    swap_bytes(bytes, static_cast<std::size_t>(number_B));
  to_floats(bytes, header, floats);
}

/// Block by block, on all cores.
void read_vectors(const StoredBytes& stored, const ImageHeader& header, std::span<glm::vec3> vectors) {
  constexpr std::int64_t kBlock = 1 << 16;
  const std::int64_t nodes = std::ssize(vectors);
  const bool is_lps = header.vector_to_lps == glm::dmat3(1);
  parallel_for((nodes + kBlock - 1) / kBlock, [&](std::int64_t block) {
    const std::int64_t first = block * kBlock, count = std::min(kBlock, nodes - first);
    const auto part = vectors.subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(count));
    if (header.are_numbers_apart) {
      std::vector<float> numbers(part.size());
      for (int d = 0; d < 3; ++d) {
        read_numbers(stored, header, d * nodes + first, numbers);
        for (std::size_t i = 0; i < part.size(); ++i) part[i][d] = numbers[i];
      }
    } else {
      read_numbers(stored, header, 3 * first, {&part[0].x, 3 * part.size()});
    }
    if (!is_lps)
      for (glm::vec3& vector : part) vector = glm::vec3(header.vector_to_lps * glm::dvec3(vector));
  });
}

std::string nrrd_header_of(const FieldGrid& grid) {
  const auto vector = [](const glm::dvec3& v) { return fmt::format("({},{},{})", v.x, v.y, v.z); };
  return fmt::format(
      "NRRD0005\ntype: float\ndimension: 4\nspace: left-posterior-superior\nsizes: 3 {} {} {}\n"
      "space directions: none {} {} {}\nkinds: vector domain domain domain\nendian: little\nencoding: raw\n"
      "space origin: {}\n\n",
      grid.size.x, grid.size.y, grid.size.z, vector(grid.step_mm[0]), vector(grid.step_mm[1]),
      vector(grid.step_mm[2]), vector(grid.origin_mm));
}

static_assert(sizeof(glm::vec3) == 3 * sizeof(float), "vectors are read and written as three floats");

}  // namespace

void validate(const FieldGrid& grid, const std::string& name) {
  constexpr std::int64_t kMaxSize = 65536;
  constexpr double kFarthest_mm = 1e6, kSingular = 1e-6;
  for (int axis = 0; axis < 3; ++axis) {
    if (grid.size[axis] < 1 || grid.size[axis] > kMaxSize)
      throw InputError("{}: size {} x {} x {} is outside 1 to {} per axis; export the file again", name,
                       grid.size.x, grid.size.y, grid.size.z, kMaxSize);
    if (!(glm::length(grid.step_mm[axis]) < kFarthest_mm) || !(glm::length(grid.origin_mm) < kFarthest_mm))
      throw InputError("{}: its voxels lie more than a kilometre away; export the file again", name);
  }
  const auto& m = grid.step_mm;
  // Written so that NaN is refused.
  if (!(std::abs(glm::determinant(m)) >
        kSingular * glm::length(m[0]) * glm::length(m[1]) * glm::length(m[2])))
    throw InputError("{}: the direction matrix is singular; export the file again with its orientation",
                     name);
}

bool is_image_file(const fs::path& path) { return image_format_of(path) != ImageFormat::none; }

VectorImage read_vector_image(const fs::path& path) {
  require_regular_file(path);
  ImageFile file = read_image_file(path);
  VectorImage image{grid_of(file.header), {}, std::move(file.warnings)};
  const std::int64_t nodes = image.grid.nodes(), needed_B = 3 * nodes * bytes_of(file.header.type);
  const StoredBytes stored(path.string(), file.voxels, needed_B);
  const std::int64_t vectors_B = nodes * static_cast<std::int64_t>(sizeof(glm::vec3));
  require_memory(fmt::format("the field {}", path.string()), {vectors_B, vectors_B});
  image.vectors.resize(static_cast<std::size_t>(nodes));
  read_vectors(stored, file.header, image.vectors);
  return image;
}

void write_vector_image(const VectorImage& image, const fs::path& path) {
  AtomicFile target(path);
  const std::string header = nrrd_header_of(image.grid);
  const auto vectors_B = static_cast<std::int64_t>(image.vectors.size() * sizeof(glm::vec3));
  target.write(header, std::ssize(header) + vectors_B);
  target.write({reinterpret_cast<const char*>(image.vectors.data()), static_cast<std::size_t>(vectors_B)},
               std::ssize(header) + vectors_B);
  target.commit();
}

}  // namespace xraycast
