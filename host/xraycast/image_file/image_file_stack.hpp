#pragma once

#include "xraycast/image_file/inflated_voxels.hpp"
#include "xraycast/image_file/raw_voxels.hpp"
#include "xraycast/volume/slice_stack.hpp"

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <variant>
#include <vector>

namespace xraycast {

/// The stored type of a voxel.
enum class VoxelType { int8, uint8, int16, uint16, int32, uint32, int64, uint64, float32, float64 };

std::int64_t bytes_of(VoxelType type);

/// Calls `visit` with a number of the type that voxels are stored as.
template <typename Visit>
auto with_voxel_type(VoxelType type, const Visit& visit) {
  switch (type) {
    case VoxelType::int8:
      return visit(std::int8_t{});
    case VoxelType::uint8:
      return visit(std::uint8_t{});
    case VoxelType::int16:
      return visit(std::int16_t{});
    case VoxelType::uint16:
      return visit(std::uint16_t{});
    case VoxelType::int32:
      return visit(std::int32_t{});
    case VoxelType::uint32:
      return visit(std::uint32_t{});
    case VoxelType::int64:
      return visit(std::int64_t{});
    case VoxelType::uint64:
      return visit(std::uint64_t{});
    case VoxelType::float32:
      return visit(float{});
    case VoxelType::float64:
      break;
  }
  return visit(double{});
}

/// The content of an image file's header.
struct ImageHeader {
  std::filesystem::path path;           ///< the user's path, for messages
  std::vector<std::int64_t> size;       ///< voxels along each axis, the one stored next to each other first
  std::array<glm::dvec3, 3> step_mm{};  ///< LPS, from a voxel to the next along each of the first three axes
  glm::dvec3 origin_mm{0, 0, 0};        ///< LPS, of the first voxel
  std::int64_t numbers_per_voxel = 1;
  bool are_numbers_apart = false;    ///< the first number of all voxels, then the second, not side by side
  glm::dmat3 vector_to_lps{1};       ///< turns the three numbers of a voxel, where they are a vector
  bool has_numbers_between = false;  ///< stored between two of the volume's axes; not supported
  VoxelType type = VoxelType::int16;
  bool is_big_endian = false;
  double slope = 1, intercept = 0;  ///< HU = slope * stored + intercept
};

/// The files with uncompressed voxels, from `offset_B` of each on, with the same number of slices in each.
struct PlainVoxels {
  static constexpr std::int64_t kAtTheEnd = -1;  ///< the last bytes, however many lie before them
  std::vector<std::filesystem::path> files;
  std::int64_t offset_B = 0;
  std::int64_t header_B = 0;  ///< that precede voxels at the end
};

/// Voxels that are in memory already.
struct LoadedVoxels {
  std::string bytes;
};

using StoredVoxels = std::variant<PlainVoxels, PackedVoxels, LoadedVoxels>;

/// A volume within one file or in a few.
class ImageFileStack final : public SliceStack {
 public:
  /// Throws InputError unless the file is a three-dimensional scan with one number per voxel, and for files
  /// that are missing, not regular, or too short for the header.
  ImageFileStack(ImageHeader header, StoredVoxels voxels);

 private:
  void prepare() override;
  SliceSource::HuRange decode_slice(std::int64_t slice, std::span<std::int16_t> hu) const override;
  void check_header() const;
  void check_files();
  std::int64_t slice_B() const { return columns * rows * bytes_of(header_.type); }
  void read_slice(std::int64_t stored, std::span<char> bytes) const;

  ImageHeader header_;
  StoredVoxels voxels_;
  std::int64_t slices_;
  bool reversed_;                     ///< the last stored slice is the lowest
  std::unique_ptr<char[]> unpacked_;  ///< all slices, once the first compressed one was requested
};

/// What a file's header says, and where its voxels are. The files are there; their length is not checked.
struct ImageFile {
  ImageHeader header;
  StoredVoxels voxels;
  std::vector<std::string> warnings;
};

/// The readers' first step, also for files of vectors. Throws InputError.
ImageFile read_nrrd(const std::filesystem::path& path);
ImageFile read_meta_image(const std::filesystem::path& path);
ImageFile read_nifti(const std::filesystem::path& path);

/// The first of the stored bytes, once the length of the file is known. Throws InputError when it is too
/// short.
RawVoxels opened(const PlainVoxels& voxels, std::int64_t needed_B);

/// Reverses the bytes of each of the numbers.
void swap_bytes(std::span<char> bytes, std::size_t number_B);

/// The readers' last step.
Scan deliver_image(ImageFile file, const char* format, const ScanOptions& options);

/// The patient's sides towards which the stored axes point, three letters.
std::string orientation_of(const ImageHeader& header);

/// A warning that the file does not state the patient's orientation; `fault` says what is missing.
std::string unknown_orientation(const std::string& fault, const ImageHeader& header);

/// A file that a header names, beside it. Throws InputError, with the header's name in front, where there is
/// no such regular file.
std::filesystem::path data_file_beside(const std::filesystem::path& header, const std::string& name);

/// Throws InputError, naming the field, for spacings that are not finite and above zero: libraries replace
/// them by 1.
void require_spacing(const std::filesystem::path& path, const char* field,
                     std::span<const double> spacing_mm);

}  // namespace xraycast
