#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/image_file/image_file_scan.hpp"
#include "xraycast/image_file/image_file_stack.hpp"
#include "xraycast/image_file/text_header.hpp"

#include <itkNrrdImageIO.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iostream>
#include <map>
#include <optional>
#include <sstream>

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
  using enum itk::CommonEnums::IOComponent;
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

// ---- NRRD ----------------------------------------------------------------------------------------

/// Of a field that may be missing.
std::int64_t nrrd_number(const fs::path& path, const TextHeader& header, const char* field) {
  const std::string& text = header.get(field);
  if (text.empty()) return 0;
  std::int64_t number = 0;
  if (!parse_whole(text, number))
    throw InputError("{}: {} is '{}', not a whole number; export the file again", path.string(), field, text);
  return number;
}

void check_nrrd(const fs::path& path, const TextHeader& header) {
  const std::int64_t dimension = nrrd_number(path, header, "dimension");
  constexpr std::int64_t kMaxDimensions = 16;
  if (dimension < 1 || dimension > kMaxDimensions)
    throw InputError(
        "{}: dimension is missing or not 1 to {}, so the header is damaged; export the file again",
        path.string(), kMaxDimensions);
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

Scan open_nrrd(const fs::path& path, const ScanOptions& options, Progress& progress) {
  progress.begin("opening", 1, "files");
  const TextHeader nrrd = read_nrrd_header(path);
  check_nrrd_encoding(path, nrrd);
  check_nrrd(path, nrrd);
  StoredVoxels voxels = nrrd_voxels(path, nrrd);
  const auto io = itk::NrrdImageIO::New();
  ImageHeader header = read_by_itk(*io, path);
  const std::optional<VoxelType> type = voxel_type(io->GetComponentType());
  if (!type)
    throw InputError("{}: voxels of type '{}' are not supported; save them as short", path.string(),
                     nrrd.get("type"));
  header.type = *type;
  header.is_big_endian = lower_case(nrrd.get("endian")) == "big";

  std::vector<std::string> warnings;
  if (nrrd.get("space").empty()) warnings.push_back(unknown_orientation("no `space`", header));
  progress.advance();
  return deliver_image(std::move(header), std::move(voxels), "NRRD", std::move(warnings), options);
}

}  // namespace xraycast
