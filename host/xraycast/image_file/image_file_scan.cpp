#include "xraycast/image_file/image_file_scan.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/image_file/image_file_stack.hpp"
#include "xraycast/image_file/text_header.hpp"

#include <glm/geometric.hpp>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iostream>
#include <map>
#include <optional>
#include <sstream>
#include <zlib.h>

// ITK reads the headers, once they are checked for what it would not survive or not notice: it replaces
// spacings that are not numbers by 1, does not come back from some matrices that are none, and writes past
// its memory for some encodings. The voxels are read here: ITK does not look at checksums, and fills what a
// truncated file lacks with zeros.
namespace xraycast {
namespace {

namespace fs = std::filesystem;

/// ITK and its VNL write warnings about a header to std::cerr; xraycast's own messages replace them.
class QuietCerr {
 public:
  QuietCerr() : buffer_(std::cerr.rdbuf(nullptr)) {}
  ~QuietCerr() { std::cerr.rdbuf(buffer_); }
  QuietCerr(const QuietCerr&) = delete;
  QuietCerr& operator=(const QuietCerr&) = delete;

 private:
  std::streambuf* buffer_;
};

std::optional<VoxelType> voxel_type(itk::IOComponentEnum component) {
  using enum itk::IOComponentEnum;
  static const std::map<itk::IOComponentEnum, VoxelType> kTypes{
      {CHAR, VoxelType::int8},        {UCHAR, VoxelType::uint8},    {SHORT, VoxelType::int16},
      {USHORT, VoxelType::uint16},    {INT, VoxelType::int32},      {UINT, VoxelType::uint32},
      {LONG, VoxelType::int64},       {LONGLONG, VoxelType::int64}, {ULONG, VoxelType::uint64},
      {ULONGLONG, VoxelType::uint64}, {FLOAT, VoxelType::float32},  {DOUBLE, VoxelType::float64}};
  const auto found = kTypes.find(component);
  return found == kTypes.end() ? std::nullopt : std::optional(found->second);
}

/// A header's sizes and place, as ITK reads them.
ImageHeader read_by_itk(itk::ImageIOBase& io, const fs::path& path) {
  try {
    const QuietCerr quiet;
    itk::Object::GlobalWarningDisplayOff();
    io.SetFileName(path.string());
    io.ReadImageInformation();
  } catch (const std::exception&) {
    throw InputError("{}: the header is damaged; export the file again", path.string());
  }
  ImageHeader header;
  header.path = path;
  header.numbers_per_voxel = io.GetNumberOfComponents();
  const unsigned dimensions = io.GetNumberOfDimensions();
  for (unsigned d = 0; d < dimensions; ++d)
    header.size.push_back(static_cast<std::int64_t>(io.GetDimensions(d)));
  for (unsigned axis = 0; axis < std::min(3U, dimensions); ++axis) {
    const std::vector<double> direction = io.GetDirection(axis);
    for (unsigned d = 0; d < std::min(3U, dimensions); ++d)
      header.step_mm[axis][static_cast<int>(d)] = direction[d] * io.GetSpacing(axis);
    header.origin_mm[static_cast<int>(axis)] = io.GetOrigin(axis);
  }
  return header;
}

// ---- NIfTI ---------------------------------------------------------------------------------------

/// A NIfTI-1 header's numbers, by their byte offset.
class NiftiHeader {
 public:
  explicit NiftiHeader(const fs::path& path) {
    // Reads plain files as they are.
    const std::unique_ptr<gzFile_s, decltype(&gzclose)> file(gzopen(path.c_str(), "rb"), &gzclose);
    if (!file || gzread(file.get(), bytes_.data(), kSize) != kSize)
      throw InputError("{}: truncated within its header; copy the file again", path.string());
    swapped_ = get<std::int32_t>(0) != kSize;
  }

  template <typename T>
  T get(std::size_t offset) const {
    std::array<char, sizeof(T)> bytes;
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(offset), sizeof(T), bytes.begin());
    if (swapped_) std::ranges::reverse(bytes);
    return std::bit_cast<T>(bytes);
  }

  /// `count` floats in a row.
  std::vector<double> floats(std::size_t offset, std::size_t count) const {
    std::vector<double> values;
    for (std::size_t i = 0; i < count; ++i) values.push_back(get<float>(offset + 4 * i));
    return values;
  }

  /// `n+1` holds the voxels too, `ni1` has them in an .img beside it.
  bool is_pair() const { return bytes_[345] == 'i'; }
  bool is_big_endian() const { return swapped_ == (std::endian::native == std::endian::little); }

 private:
  static constexpr int kSize = 348;
  std::array<char, kSize> bytes_{};
  bool swapped_ = false;
};

void require_finite(const fs::path& path, const char* field, const std::vector<double>& values) {
  for (const double value : values)
    if (!std::isfinite(value))
      throw InputError("{}: {} holds {}; export the file again with its orientation", path.string(), field,
                       value);
}

void check_nifti(const fs::path& path, const NiftiHeader& header) {
  const int dimensions = header.get<std::int16_t>(40);
  if (dimensions < 1 || dimensions > 7)
    throw InputError("{}: dim holds {} as the number of dimensions; the header is damaged", path.string(),
                     dimensions);
  for (int d = 1; d <= dimensions; ++d)
    if (const auto size = header.get<std::int16_t>(40 + 2 * static_cast<std::size_t>(d)); size < 1)
      throw InputError("{}: dim holds {}; sizes must be above zero", path.string(), size);
  require_spacing(path, "pixdim", header.floats(80, static_cast<std::size_t>(std::min(dimensions, 3))));
  require_finite(path, "pixdim", header.floats(76, 4));

  const bool has_qform = header.get<std::int16_t>(252) > 0, has_sform = header.get<std::int16_t>(254) > 0;
  if (has_qform) require_finite(path, "qform", header.floats(256, 6));
  if (!has_sform) return;
  const std::vector<double> sform = header.floats(280, 12);
  require_finite(path, "sform", sform);
  const auto row = [&](std::size_t r) {
    return glm::dvec3(sform[4 * r], sform[4 * r + 1], sform[4 * r + 2]);
  };
  if (!has_qform && glm::dot(glm::cross(row(0), row(1)), row(2)) == 0)
    throw InputError("{}: sform is a singular matrix; export the file again with its orientation",
                     path.string());
}

bool is_gzipped(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return stream.get() == 0x1f && stream.get() == 0x8b;
}

/// The file with a pair's voxels.
fs::path voxels_beside(const fs::path& header) {
  const fs::path stem =
      fs::path(header).replace_extension(header.extension() == ".gz" ? "" : header.extension());
  fs::path plain = fs::path(stem).replace_extension(".img"), packed = plain;
  packed += ".gz";
  std::error_code error;
  return data_file_beside(header, (fs::is_regular_file(plain, error) ? plain : packed).filename().string());
}

StoredVoxels nifti_voxels(const fs::path& path, const NiftiHeader& header) {
  // In a single file they start behind the header, whatever it says.
  const double stated_B = header.get<float>(108), least_B = header.is_pair() ? 0 : 348;
  if (!(std::abs(stated_B) < 1e9))
    throw InputError("{}: vox_offset is {}; the header is damaged", path.string(), stated_B);
  const auto offset_B = static_cast<std::int64_t>(std::max(stated_B, least_B));
  const fs::path file = header.is_pair() ? voxels_beside(path) : path;
  if (is_gzipped(file)) return PackedVoxels{file, 0, offset_B};
  return PlainVoxels{{file}, offset_B};
}

VoxelType nifti_type(const fs::path& path, const NiftiHeader& header) {
  static const std::map<int, VoxelType> kTypes{
      {2, VoxelType::uint8},    {4, VoxelType::int16},    {8, VoxelType::int32},    {16, VoxelType::float32},
      {64, VoxelType::float64}, {256, VoxelType::int8},   {512, VoxelType::uint16}, {768, VoxelType::uint32},
      {1024, VoxelType::int64}, {1280, VoxelType::uint64}};
  const auto found = kTypes.find(header.get<std::int16_t>(70));
  if (found == kTypes.end())
    throw InputError(
        "{}: datatype is {}: colours or vectors, or unknown; a CT scan has one integer or float per voxel",
        path.string(), header.get<std::int16_t>(70));
  return found->second;
}

// ---- NRRD ----------------------------------------------------------------------------------------

/// Of a field that may be missing.
std::int64_t nrrd_number(const fs::path& path, const TextHeader& header, const char* field) {
  const std::string& text = header.get(field);
  if (text.empty()) return 0;
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || end != text.data() + text.size())
    throw InputError("{}: {} is '{}', not a whole number", path.string(), field, text);
  return number;
}

void check_nrrd(const fs::path& path, const TextHeader& header) {
  const std::int64_t dimension = nrrd_number(path, header, "dimension");
  constexpr std::int64_t kMaxDimensions = 16;
  if (dimension < 1 || dimension > kMaxDimensions)
    throw InputError("{}: dimension is missing or not 1 to {}, so the header is damaged", path.string(),
                     kMaxDimensions);
  std::vector<double> spacing_mm;
  std::istringstream words(header.get("spacings"));
  // Not read as doubles: streams refuse `nan`, which must be noticed.
  for (std::string word; words >> word;)
    if (double mm = 0; std::from_chars(word.data(), word.data() + word.size(), mm).ec == std::errc{})
      spacing_mm.push_back(mm);
  require_spacing(path, "spacings", spacing_mm);
}

StoredVoxels nrrd_voxels(const fs::path& path, const TextHeader& header) {
  const std::string& encoding = header.get("encoding");
  const bool is_packed = encoding == "gzip" || encoding == "gz";
  const std::string data_file = header.get("data file") + header.get("datafile");
  const fs::path file = data_file.empty() ? path : data_file_beside(path, data_file);
  const std::int64_t start_B = data_file.empty() ? header.end_B : 0;
  const std::int64_t skipped_B =
      nrrd_number(path, header, header.get("byte skip").empty() ? "byteskip" : "byte skip");
  constexpr std::int64_t kMaxSkip_B = std::int64_t{1} << 40;
  if (skipped_B < -1 || skipped_B > kMaxSkip_B || (skipped_B < 0 && is_packed))
    throw InputError("{}: byte skip is {}; save the file again without it", path.string(), skipped_B);
  if (is_packed) return PackedVoxels{file, start_B, skipped_B};
  return PlainVoxels{{file}, skipped_B < 0 ? PlainVoxels::kAtTheEnd : start_B + skipped_B};
}

/// Refuses what ITK would not survive.
void check_nrrd_encoding(const fs::path& path, const TextHeader& header) {
  const std::string& encoding = header.get("encoding");
  if (encoding.empty())
    throw InputError("{}: encoding is missing, so the header is damaged; export the file again",
                     path.string());
  if (encoding != "raw" && encoding != "gzip" && encoding != "gz")
    throw InputError("{}: encoding {} is not supported; save the file as raw or gzip", path.string(),
                     encoding);
  const std::string data_file = header.get("data file") + header.get("datafile");
  if (data_file.starts_with("LIST") || data_file.find('%') != std::string::npos)
    throw InputError("{}: data file '{}' names several files; save the scan as one file", path.string(),
                     data_file);
  if (nrrd_number(path, header, "line skip") != 0 || nrrd_number(path, header, "lineskip") != 0)
    throw InputError("{}: line skip is not supported; save the file again without it", path.string());
}

}  // namespace

Scan open_nifti(const fs::path& path, const ScanOptions& options, Progress& progress) {
  progress.begin("opening", 1, "files");
  const NiftiHeader nifti(path);
  check_nifti(path, nifti);
  const VoxelType type = nifti_type(path, nifti);
  auto io = itk::NiftiImageIO::New();
  if (!io->CanReadFile(path.c_str()))
    throw InputError("{}: NIfTI by its content, but {}", path.string(),
                     is_gzipped(path) ? "damaged or not named .nii.gz; rename it"
                                      : "damaged or not named .nii; rename it");
  ImageHeader header = read_by_itk(*io, path);
  header.type = type;
  header.is_big_endian = nifti.is_big_endian();
  // A slope of zero, or none, says that the voxels are not scaled.
  if (const double slope = nifti.get<float>(112); std::isfinite(slope) && slope != 0) {
    header.slope = slope;
    const double intercept = nifti.get<float>(116);
    header.intercept = std::isfinite(intercept) ? intercept : 0;
  }
  std::vector<std::string> warnings;
  if (nifti.get<std::int16_t>(252) == 0 && nifti.get<std::int16_t>(254) == 0)
    warnings.push_back(unknown_orientation("neither qform nor sform", header));
  progress.advance();
  StoredVoxels voxels = nifti_voxels(path, nifti);
  return deliver_image(std::move(header), std::move(voxels), "NIfTI", std::move(warnings), options);
}

Scan open_nrrd(const fs::path& path, const ScanOptions& options, Progress& progress) {
  progress.begin("opening", 1, "files");
  const TextHeader nrrd = read_nrrd_header(path);
  check_nrrd_encoding(path, nrrd);
  check_nrrd(path, nrrd);
  StoredVoxels voxels = nrrd_voxels(path, nrrd);
  const auto io = itk::NrrdImageIO::New();
  ImageHeader header = read_by_itk(*io, path);
  const std::optional<VoxelType> type = voxel_type(io->GetComponentType());
  if (!type) throw InputError("{}: voxels of type '{}' are not supported", path.string(), nrrd.get("type"));
  header.type = *type;
  header.is_big_endian = lower_case(nrrd.get("endian")) == "big";

  std::vector<std::string> warnings;
  if (nrrd.get("space").empty()) warnings.push_back(unknown_orientation("no `space`", header));
  progress.advance();
  return deliver_image(std::move(header), std::move(voxels), "NRRD", std::move(warnings), options);
}

}  // namespace xraycast
