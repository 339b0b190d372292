#include "xraycast/image_file/write_volume.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/whole_file.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>
#include <vector>
#include <zlib.h>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little,
              "the headers below say that voxels are little-endian");

/// A file of bytes, gzipped or plain, that detects a full disk.
class OutputFile {
 public:
  /// `content_B` is what it will hold.
  OutputFile(const fs::path& path, bool gzipped, std::int64_t content_B)
      : atomic_(path), needed_B_(content_B) {
    // T writes plainly through the same functions.
    file_ = gzopen(atomic_.temporary().c_str(), gzipped ? "wb6" : "wbT");
    if (!file_) throw atomic_.failure(errno, needed_B_);
  }
  ~OutputFile() {
    if (file_) gzclose(file_);
  }
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void write(const void* bytes, std::int64_t count) {
    errno = 0;
    // Not gzwrite, which takes less than 2 GiB.
    const auto size = static_cast<std::size_t>(count);
    if (gzfwrite(bytes, 1, size, file_) != size) throw atomic_.failure(errno, needed_B_);
  }
  void write(const std::string& text) { write(text.data(), std::ssize(text)); }

  /// What follows is gzipped.
  void continue_gzipped() {
    errno = 0;
    if (gzclose(std::exchange(file_, nullptr)) != Z_OK) throw atomic_.failure(errno, needed_B_);
    file_ = gzopen(atomic_.temporary().c_str(), "ab6");
    if (!file_) throw atomic_.failure(errno, needed_B_);
  }

  void commit() {
    errno = 0;
    if (gzclose(std::exchange(file_, nullptr)) != Z_OK) throw atomic_.failure(errno, needed_B_);
    atomic_.commit();
  }

 private:
  AtomicFile atomic_;
  std::int64_t needed_B_;
  gzFile file_;
};

/// The names of a voxel type in headers.
struct VoxelType {
  const char* nrrd;
  const char* meta_image;
  std::int16_t nifti_code, nifti_bits;
};
template <typename T>
constexpr VoxelType kVoxelType{};
template <>
constexpr VoxelType kVoxelType<std::uint8_t>{"unsigned char", "MET_UCHAR", 2, 8};
template <>
constexpr VoxelType kVoxelType<std::int16_t>{"short", "MET_SHORT", 4, 16};
template <>
constexpr VoxelType kVoxelType<float>{"float", "MET_FLOAT", 16, 32};

// ---- headers -------------------------------------------------------------------------------------

std::string nrrd_header(const VolumeGeometry& geometry, const VoxelType& type,
                        const std::string& encoding = "raw") {
  const auto& [size, spacing, origin] = geometry;
  return fmt::format(
      "NRRD0004\ntype: {}\ndimension: 3\nspace: left-posterior-superior\nsizes: {} {} {}\n"
      "space directions: ({},0,0) (0,{},0) (0,0,{})\nkinds: domain domain domain\nendian: little\nencoding: "
      "{}\n"
      "space origin: ({},{},{})\n\n",
      type.nrrd, size.x, size.y, size.z, spacing.x, spacing.y, spacing.z, encoding, origin.x, origin.y,
      origin.z);
}

std::string meta_image_header(const VolumeGeometry& geometry, const VoxelType& type,
                              const std::string& data_file) {
  const auto& [size, spacing, origin] = geometry;
  return fmt::format(
      "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = "
      "False\n"
      "TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = {} {} {}\nCenterOfRotation = 0 0 "
      "0\nAnatomicalOrientation = RAI\n"
      "ElementSpacing = {} {} {}\nDimSize = {} {} {}\nElementType = {}\nElementDataFile = {}\n",
      origin.x, origin.y, origin.z, spacing.x, spacing.y, spacing.z, size.x, size.y, size.z, type.meta_image,
      data_file);
}

/// NIfTI-1 keeps sizes as int16, spacing and origin as floats, and counts towards right-to-left and
/// back-to-front.
std::string nifti_header(const VolumeGeometry& geometry, const VoxelType& type, const fs::path& path) {
  const auto& [size, spacing, origin] = geometry;
  if (size.x > 32767 || size.y > 32767 || size.z > 32767)
    throw InputError("{}: NIfTI holds at most 32767 voxels per axis; write .nrrd or .mha instead",
                     path.string());
  std::string header(352, '\0');
  const auto put = [&](std::size_t offset, const auto& value) {
    std::memcpy(&header[offset], &value, sizeof value);
  };
  const auto narrow = [](double value) { return static_cast<float>(value); };
  const auto count = [](std::int64_t value) { return static_cast<std::int16_t>(value); };
  put(0, std::int32_t{348});
  put(40, std::array<std::int16_t, 8>{3, count(size.x), count(size.y), count(size.z), 1, 1, 1, 1});
  put(70, std::array<std::int16_t, 2>{type.nifti_code, type.nifti_bits});
  put(76, std::array<float, 8>{1, narrow(spacing.x), narrow(spacing.y), narrow(spacing.z), 0, 0, 0, 0});
  put(108, std::array<float, 3>{352, 1, 0});    // where the voxels start, slope and intercept
  put(123, char{2});                            // millimetres
  put(252, std::array<std::int16_t, 2>{1, 1});  // both transforms below lead to the scanner's frame
  // Half a turn about z, then the offset; and the same as a matrix.
  put(256, std::array<float, 6>{0, 0, 1, narrow(-origin.x), narrow(-origin.y), narrow(origin.z)});
  put(280, std::array<float, 12>{narrow(-spacing.x), 0, 0, narrow(-origin.x),  //
                                 0, narrow(-spacing.y), 0, narrow(-origin.y),  //
                                 0, 0, narrow(spacing.z), narrow(origin.z)});
  header.replace(344, 3, "n+1");
  return header;
}

/// Whether a line of text says the voxels' file, and not a pattern or list of several.
bool is_named_by_meta_image(const std::string& stem) {
  const auto is_control = [](unsigned char c) { return c < ' ' || c == 0x7f; };
  return !stem.starts_with(' ') && !stem.starts_with("LIST") && stem.find('%') == std::string::npos &&
         std::ranges::none_of(stem, is_control);
}

template <typename T>
void write(const VolumeGeometry& geometry, std::span<const T> voxels, const fs::path& path,
           Progress& progress) {
  const VoxelType& type = kVoxelType<T>;
  check_volume_format(path);
  const bool is_in_two_files = has_extension(path, ".mhd");
  const fs::path voxel_path = is_in_two_files ? fs::path(path).replace_extension(".raw") : path;
  std::string header;
  if (has_extension(path, ".nrrd"))
    header = nrrd_header(geometry, type);
  else if (has_extension(path, ".nii") || has_extension(path, ".nii.gz"))
    header = nifti_header(geometry, type, path);
  else
    header = meta_image_header(geometry, type,
                               is_in_two_files ? voxel_path.filename().string() : std::string("LOCAL"));

  progress.begin("writing", geometry.size.z, "slices");
  const auto slice_B = geometry.slice_voxels() * static_cast<std::int64_t>(sizeof(T));
  const std::int64_t header_B = is_in_two_files ? 0 : std::ssize(header);
  OutputSet outputs;
  OutputFile voxel_file(voxel_path, has_extension(path, ".gz"), header_B + slice_B * geometry.size.z);
  if (!is_in_two_files) voxel_file.write(header);
  for (std::int64_t z = 0; z < geometry.size.z; ++z) {
    check_cancelled();
    voxel_file.write(voxels.data() + z * geometry.slice_voxels(), slice_B);
    progress.advance();
  }
  // The voxels first: a header never names a missing file.
  voxel_file.commit();
  if (is_in_two_files) write_whole_file(path, header);
  outputs.commit();
}

}  // namespace

void check_volume_format(const fs::path& path) {
  constexpr std::string_view kKnown[] = {".nrrd", ".nii", ".nii.gz", ".mha", ".mhd"};
  if (std::ranges::none_of(kKnown,
                           [&](std::string_view extension) { return has_extension(path, extension); }))
    throw InputError("{}: unknown volume format; end the name in .nrrd, .nii, .nii.gz, .mha or .mhd",
                     path.string());
  if (has_extension(path, ".mhd") && !is_named_by_meta_image(path.stem().string()))
    throw InputError(
        "{}: a MetaImage header cannot name voxels' files that start with a blank or LIST, or hold a % or "
        "control characters; choose another name or .mha",
        path.string());
}

void write_volume(const Volume& volume, const fs::path& path, Progress& progress) {
  write(volume.geometry(), volume.hu(), path, progress);
}

void write_field(const VolumeGeometry& geometry, std::span<const float> field, const fs::path& path,
                 Progress& progress) {
  write(geometry, field, path, progress);
}

void write_fractions(const VolumeGeometry& geometry, std::span<const std::uint8_t> fractions,
                     const fs::path& path) {
  const std::string header = nrrd_header(geometry, kVoxelType<float>, "gzip");
  OutputFile file(path, false, std::ssize(header) + geometry.voxel_count() / 64);  // mostly zeros
  file.write(header);
  file.continue_gzipped();
  const auto slice = static_cast<std::size_t>(geometry.slice_voxels());
  std::vector<float> values(slice);
  for (std::int64_t z = 0; z < geometry.size.z; ++z) {
    check_cancelled();
    std::ranges::transform(fractions.subspan(static_cast<std::size_t>(z) * slice, slice), values.begin(),
                           [](std::uint8_t fraction) { return static_cast<float>(fraction) / 255.0F; });
    file.write(values.data(), static_cast<std::int64_t>(slice * sizeof(float)));
  }
  file.commit();
}

void write_mask(const VolumeGeometry& geometry, std::span<const std::uint8_t> mask, const fs::path& path) {
  Progress unheard;
  write(geometry, mask, path, unheard);
}

}  // namespace xraycast
