#include "xraycast/scan/image_file_scan.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/scan/raw_voxels.hpp"
#include "xraycast/scan/rescale.hpp"
#include "xraycast/scan/slice_stack.hpp"

#include <glm/geometric.hpp>
#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iostream>
#include <map>
#include <optional>
#include <sstream>
#include <zlib.h>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

/// ITK's MetaIO writes its complaints to std::cerr before it fails; ours say more.
class QuietCerr {
 public:
  QuietCerr() : buffer_(std::cerr.rdbuf(nullptr)) {}
  ~QuietCerr() { std::cerr.rdbuf(buffer_); }
  QuietCerr(const QuietCerr&) = delete;
  QuietCerr& operator=(const QuietCerr&) = delete;

 private:
  std::streambuf* buffer_;
};

// ---- what ITK would not notice -------------------------------------------------------------------
// ITK replaces spacings that are not numbers by 1, and fills what a truncated file lacks with zeros.

/// Where a header says that the voxels are, one after the other.
struct StoredVoxels {
  fs::path file;
  std::int64_t offset_B = 0;
  /// Not set where the header spells it in a way that only ITK knows, which then reads them.
  std::optional<bool> is_big_endian{};
};

/// A file of at least so many bytes behind an offset, or an InputError.
void require_size(const StoredVoxels& voxels, std::int64_t needed_B) {
  RawVoxels(voxels.file, voxels.offset_B, needed_B);
}

/// The data file that a header names.
fs::path beside(const fs::path& path, const std::string& data_file) {
  const fs::path file = path.parent_path() / data_file;
  if (!fs::is_regular_file(file))
    throw InputError("{}: its data file {} is missing; put it beside the header", path.string(), data_file);
  return file;
}

void require_spacing(const fs::path& path, const char* field, std::span<const double> spacing_mm) {
  for (const double mm : spacing_mm)
    if (!std::isfinite(mm) || mm <= 0)
      throw InputError("{}: {} holds {}; spacing has to be finite and above zero", path.string(), field, mm);
}

/// The numbers of a text, whatever stands between them.
std::vector<double> numbers(const std::string& text) {
  std::string plain = text;
  std::ranges::replace_if(
      plain, [](char c) { return std::strchr("(),\t", c) != nullptr; }, ' ');
  std::istringstream words(plain);
  std::vector<double> result;
  // Not read as doubles: streams refuse `nan`, which has to be noticed.
  for (std::string word; words >> word;) {
    double value = 0;
    if (std::from_chars(word.data(), word.data() + word.size(), value).ec == std::errc{})
      result.push_back(value);
  }
  return result;
}

std::string trimmed(const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r");
  return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

/// The fields of a text header, and the offset of what follows it.
struct TextHeader {
  std::map<std::string, std::string> fields;
  std::int64_t end_B = 0;

  std::string get(const std::string& name) const {
    const auto field = fields.find(name);
    return field == fields.end() ? "" : field->second;
  }
};

/// Up to an empty line or the field `last`.
TextHeader read_text_header(const fs::path& path, char separator, const std::string& last) {
  std::ifstream stream(path, std::ios::binary);
  TextHeader header;
  for (std::string line; std::getline(stream, line) && !trimmed(line).empty();) {
    const auto at = line.find(separator);
    if (at == std::string::npos) continue;
    const std::string name = trimmed(line.substr(0, at));
    header.fields[name] = trimmed(line.substr(at + 1));
    if (name == last) break;
  }
  if (stream) header.end_B = stream.tellg();
  return header;
}

// ---- the stack -----------------------------------------------------------------------------------

void swap_bytes(std::span<char> bytes, std::size_t component_B) {
  for (std::size_t i = 0; i + component_B <= bytes.size(); i += component_B)
    std::reverse(bytes.data() + i, bytes.data() + i + component_B);
}

template <typename T>
SliceSource::HuRange rescale_bytes(const char* bytes, std::span<std::int16_t> hu) {
  return rescale(std::span(reinterpret_cast<const T*>(bytes), hu.size()), 1, 0, hu);
}

class ImageFileStack final : public SliceStack {
 public:
  ImageFileStack(itk::ImageIOBase::Pointer io, const fs::path& path) : io_(std::move(io)) {
    try {
      const QuietCerr quiet;
      itk::Object::GlobalWarningDisplayOff();
      io_->SetFileName(path.string());
      io_->ReadImageInformation();
    } catch (const std::exception&) {
      throw InputError("{}: the header is damaged; export the file again", path.string());
    }
    name = path.string();
    const unsigned dimensions = io_->GetNumberOfDimensions();
    for (unsigned d = 3; d < dimensions; ++d)
      if (io_->GetDimensions(d) > 1)
        throw InputError("{}: {} dimensions; a scan has three, so take one volume out of it", name,
                         dimensions);
    if (io_->GetPixelType() != itk::IOPixelEnum::SCALAR || io_->GetNumberOfComponents() != 1)
      throw InputError("{}: {} numbers a voxel (colours or vectors); a CT scan has one", name,
                       io_->GetNumberOfComponents());
    constexpr std::size_t kMaxSize = 65536;
    for (unsigned d = 0; d < dimensions; ++d)
      if (io_->GetDimensions(d) < 1 || io_->GetDimensions(d) > kMaxSize)
        throw InputError("{}: {} voxels along axis {} are outside 1 to {}", name, io_->GetDimensions(d),
                         d + 1, kMaxSize);

    columns = static_cast<std::int64_t>(io_->GetDimensions(0));
    rows = dimensions > 1 ? static_cast<std::int64_t>(io_->GetDimensions(1)) : 1;
    slices_ = dimensions > 2 ? static_cast<std::int64_t>(io_->GetDimensions(2)) : 1;
    const glm::dvec3 i = step_mm(0), j = step_mm(1), k = dimensions > 2 ? step_mm(2) : glm::dvec3(0);
    // Three dimensions span a volume, two leave the thickness open.
    if (dimensions > 2 &&
        !(std::abs(glm::dot(glm::cross(i, j), k)) > 1e-6 * glm::length(i) * glm::length(j) * glm::length(k)))
      throw InputError("{}: the direction matrix is singular; export the file again with its orientation",
                       name);
    thickness_mm = glm::length(k);
    glm::dvec3 origin_mm(0);
    for (unsigned d = 0; d < std::min(3U, dimensions); ++d)
      origin_mm[static_cast<int>(d)] = io_->GetOrigin(d);
    reversed_ = glm::dot(k, upward(glm::cross(i, j))) < 0;
    for (std::int64_t s = 0; s < slices_; ++s)
      planes.push_back({origin_mm + static_cast<double>(reversed_ ? slices_ - 1 - s : s) * k, i, j});
  }

  std::string orientation() const {
    return {side(step_mm(0)), side(step_mm(1)),
            slices_ > 1 || thickness_mm > 0 ? side(step_mm(2)) : side(glm::cross(step_mm(0), step_mm(1)))};
  }

  /// Reads the voxels from here rather than through ITK, which takes one core, and for NRRD the whole volume.
  void read_from(const StoredVoxels& voxels) {
    RawVoxels raw(voxels.file, voxels.offset_B, slice_B() * slices_);
    if (!voxels.is_big_endian) return;
    raw_.emplace(std::move(raw));
    swapped_ = *voxels.is_big_endian == (std::endian::native == std::endian::little);
  }

  SliceSource::HuRange decode(std::int64_t first, std::span<std::int16_t* const> destinations) override {
    return raw_ ? decode_raw(first, destinations) : decode_by_itk(first, destinations);
  }

 private:
  std::int64_t slice_B() const { return columns * rows * static_cast<std::int64_t>(io_->GetComponentSize()); }

  SliceSource::HuRange decode_raw(std::int64_t first, std::span<std::int16_t* const> destinations) {
    std::vector<SliceSource::HuRange> ranges(destinations.size());
    parallel_for(std::ssize(destinations), [&](std::int64_t s) {
      const std::span hu(destinations[static_cast<std::size_t>(s)], static_cast<std::size_t>(columns * rows));
      // 16-bit voxels become HU where they are.
      std::vector<char> wider(io_->GetComponentSize() == sizeof(std::int16_t) ? 0 : slice_B());
      const std::span bytes =
          wider.empty() ? std::span(reinterpret_cast<char*>(hu.data()), hu.size_bytes()) : std::span(wider);
      raw_->read((reversed_ ? slices_ - 1 - first - s : first + s) * slice_B(), bytes);
      if (swapped_) swap_bytes(bytes, io_->GetComponentSize());
      ranges[static_cast<std::size_t>(s)] = rescale_slice(bytes.data(), hu);
    });
    SliceSource::HuRange range = kNoHu;
    for (const SliceSource::HuRange& one : ranges) include(range, one);
    return range;
  }

  SliceSource::HuRange decode_by_itk(std::int64_t first, std::span<std::int16_t* const> destinations) {
    const std::int64_t count = std::ssize(destinations);
    const std::int64_t first_stored = reversed_ ? slices_ - first - count : first;
    // Formats that cannot be read in parts are read whole, once.
    if (io_->CanStreamRead())
      read(first_stored, count);
    else if (voxels_.empty())
      read(0, slices_);

    SliceSource::HuRange range = kNoHu;
    for (std::int64_t s = 0; s < count; ++s) {
      const std::int64_t stored = first_stored + (reversed_ ? count - 1 - s : s);
      const std::span hu(destinations[static_cast<std::size_t>(s)], static_cast<std::size_t>(columns * rows));
      include(range, rescale_slice(voxels_.data() + (stored - first_voxel_slice_) * slice_B(), hu));
    }
    return range;
  }

  glm::dvec3 step_mm(unsigned axis) const {
    const std::vector<double> direction = io_->GetDirection(axis);
    glm::dvec3 step(0);
    for (unsigned d = 0; d < std::min(3U, io_->GetNumberOfDimensions()); ++d)
      step[static_cast<int>(d)] = direction[d] * io_->GetSpacing(axis);
    return step;
  }

  void read(std::int64_t first, std::int64_t count) {
    const unsigned dimensions = io_->GetNumberOfDimensions();
    itk::ImageIORegion region(dimensions);
    for (unsigned d = 0; d < dimensions; ++d) {
      region.SetIndex(d, d == 2 ? first : 0);
      region.SetSize(d, d == 2 ? static_cast<std::size_t>(count) : io_->GetDimensions(d));
    }
    first_voxel_slice_ = first;
    try {
      const QuietCerr quiet;
      voxels_.resize(static_cast<std::size_t>(count * slice_B()));
      io_->SetIORegion(region);
      io_->Read(voxels_.data());
    } catch (const std::exception&) {
      throw InputError("{}: the voxels could not be read; the file is damaged or truncated, copy it again",
                       name);
    }
  }

  SliceSource::HuRange rescale_slice(const char* bytes, std::span<std::int16_t> hu) const {
    using Type = itk::IOComponentEnum;
    switch (io_->GetComponentType()) {
      case Type::UCHAR:
        return rescale_bytes<unsigned char>(bytes, hu);
      case Type::CHAR:
        return rescale_bytes<signed char>(bytes, hu);
      case Type::USHORT:
        return rescale_bytes<unsigned short>(bytes, hu);
      case Type::SHORT:
        return rescale_bytes<short>(bytes, hu);
      case Type::UINT:
        return rescale_bytes<unsigned int>(bytes, hu);
      case Type::INT:
        return rescale_bytes<int>(bytes, hu);
      case Type::ULONG:
        return rescale_bytes<unsigned long>(bytes, hu);
      case Type::LONG:
        return rescale_bytes<long>(bytes, hu);
      case Type::ULONGLONG:
        return rescale_bytes<unsigned long long>(bytes, hu);
      case Type::LONGLONG:
        return rescale_bytes<long long>(bytes, hu);
      case Type::FLOAT:
        return rescale_bytes<float>(bytes, hu);
      case Type::DOUBLE:
        return rescale_bytes<double>(bytes, hu);
      default:
        throw InputError("{}: voxels of type {} are not supported", name,
                         itk::ImageIOBase::GetComponentTypeAsString(io_->GetComponentType()));
    }
  }

  itk::ImageIOBase::Pointer io_;
  std::int64_t slices_ = 1;
  bool reversed_ = false;
  std::optional<RawVoxels> raw_;
  bool swapped_ = false;      ///< raw_'s bytes
  std::vector<char> voxels_;  ///< as stored, from slice first_voxel_slice_ on
  std::int64_t first_voxel_slice_ = 0;
};

Scan open_image(std::unique_ptr<ImageFileStack> stack, const char* format, std::vector<std::string> warnings,
                const ScanOptions& options) {
  ScanInfo info;
  info.format = format;
  info.orientation = stack->orientation();
  info.warnings = std::move(warnings);
  return deliver(std::move(stack), std::move(info), options);
}

std::string unknown_orientation(const char* field, const std::string& orientation) {
  return fmt::format("the file does not say how the patient lies ({}); its axes are taken as {}", field,
                     orientation);
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

  /// `n+1` holds the voxels too, `ni1` has them in an .img beside it.
  bool is_pair() const { return bytes_[345] == 'i'; }

 private:
  static constexpr int kSize = 348;
  std::array<char, kSize> bytes_{};
  bool swapped_ = false;
};

void require_sizes_and_directions(const fs::path& path, const NiftiHeader& header) {
  const int dimensions = header.get<std::int16_t>(40);
  if (dimensions < 1 || dimensions > 7)
    throw InputError("{}: dim holds {} as the number of dimensions; the header is damaged", path.string(),
                     dimensions);
  for (int d = 1; d <= dimensions; ++d)
    if (const auto size = header.get<std::int16_t>(40 + 2 * static_cast<std::size_t>(d)); size < 1)
      throw InputError("{}: dim holds {}; sizes have to be above zero", path.string(), size);
  std::array<double, 3> spacing_mm{1, 1, 1};
  for (int d = 1; d <= std::min(dimensions, 3); ++d)
    spacing_mm[static_cast<std::size_t>(d - 1)] = header.get<float>(76 + 4 * static_cast<std::size_t>(d));
  require_spacing(path, "pixdim", spacing_mm);

  const bool has_qform = header.get<std::int16_t>(252) > 0, has_sform = header.get<std::int16_t>(254) > 0;
  std::array<glm::dvec3, 3> row;
  for (std::size_t r = 0; r < 3; ++r)
    row[r] = {header.get<float>(280 + 16 * r), header.get<float>(284 + 16 * r),
              header.get<float>(288 + 16 * r)};
  if (has_sform && !has_qform && glm::dot(glm::cross(row[0], row[1]), row[2]) == 0)
    throw InputError("{}: sform is a singular matrix; export the file again with its orientation",
                     path.string());
}

/// Whether a gzip file unpacks to so many bytes.
bool unpacks_to(const fs::path& path, std::int64_t bytes) {
  // It ends with its unpacked size modulo 2^32; where that fits the file is whole.
  std::ifstream stream(path, std::ios::binary);
  std::array<unsigned char, 4> tail{};
  stream.seekg(-4, std::ios::end);
  stream.read(reinterpret_cast<char*>(tail.data()), tail.size());
  const std::uint32_t size =
      tail[0] | tail[1] << 8 | tail[2] << 16 | static_cast<std::uint32_t>(tail[3]) << 24;
  if (size == static_cast<std::uint32_t>(bytes)) return true;

  // It may also be packed in several members, or hold more than we need: then only unpacking tells.
  const std::unique_ptr<gzFile_s, decltype(&gzclose)> file(gzopen(path.c_str(), "rb"), &gzclose);
  std::vector<char> buffer(1 << 20);
  while (bytes > 0) {
    const int count = gzread(file.get(), buffer.data(), static_cast<unsigned>(buffer.size()));
    if (count <= 0) return false;
    bytes -= count;
  }
  return true;
}

bool is_gzipped(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return stream.get() == 0x1f && stream.get() == 0x8b;
}

void require_nifti_voxels(const fs::path& path, const NiftiHeader& header) {
  std::int64_t needed_B = header.get<std::int16_t>(72) / 8;
  for (std::size_t d = 1; d <= 3; ++d)
    needed_B *= d <= static_cast<std::size_t>(header.get<std::int16_t>(40))
                    ? header.get<std::int16_t>(40 + 2 * d)
                    : 1;
  const auto offset_B = static_cast<std::int64_t>(header.get<float>(108));
  if (header.is_pair()) {
    fs::path voxels = path;
    // ITK also takes a packed .img.gz, which then says itself that it is cut off.
    if (fs::exists(voxels.replace_extension(".img"))) require_size({voxels, offset_B}, needed_B);
  } else if (!is_gzipped(path)) {
    require_size({path, offset_B}, needed_B);
  } else if (!unpacks_to(path, offset_B + needed_B)) {
    throw InputError("{}: truncated, it does not unpack to {} bytes of voxels; copy the file again",
                     path.string(), needed_B);
  }
}

// ---- NRRD ----------------------------------------------------------------------------------------

/// Nothing where it takes more than one file, or ITK to decode them.
std::optional<StoredVoxels> nrrd_voxels(const fs::path& path, const TextHeader& header) {
  std::string data_file = header.get("data file");
  if (data_file.empty()) data_file = header.get("datafile");
  const bool several_files = data_file.starts_with("LIST") || data_file.find('%') != std::string::npos;
  const bool skips = !header.get("line skip").empty() || !header.get("lineskip").empty() ||
                     !header.get("byte skip").empty() || !header.get("byteskip").empty();
  if (header.get("encoding") != "raw" || several_files || skips) return std::nullopt;
  const std::string endian = header.get("endian");
  std::optional<bool> is_big_endian;
  if (endian == "little" || endian == "big") is_big_endian = endian == "big";
  if (data_file.empty()) return StoredVoxels{path, header.end_B, is_big_endian};
  return StoredVoxels{beside(path, data_file), 0, is_big_endian};
}

// ---- MetaImage -----------------------------------------------------------------------------------

/// Nothing where it takes more than one file, or ITK to find them.
std::optional<StoredVoxels> meta_image_voxels(const fs::path& path, const TextHeader& header) {
  const std::string data_file = header.get("ElementDataFile"), header_size = header.get("HeaderSize");
  const bool several_files = data_file.starts_with("LIST") || data_file.find('%') != std::string::npos;
  const bool simple = header.get("BinaryData") != "False" && (header_size.empty() || header_size == "0");
  if (!simple || several_files || data_file.empty()) return std::nullopt;
  std::optional<bool> is_big_endian;
  const std::string order = header.get("BinaryDataByteOrderMSB") + header.get("ElementByteOrderMSB");
  if (header.get("BinaryData") == "True" && (order == "True" || order == "False"))
    is_big_endian = order == "True";
  if (data_file == "LOCAL" || data_file == "Local" || data_file == "local")
    return StoredVoxels{path, header.end_B, is_big_endian};
  return StoredVoxels{beside(path, data_file), 0, is_big_endian};
}

}  // namespace

Scan open_nifti(const fs::path& path, const ScanOptions& options, Progress& progress) {
  progress.begin("opening", 1, "files");
  const NiftiHeader header(path);
  require_sizes_and_directions(path, header);

  auto io = itk::NiftiImageIO::New();
  if (!io->CanReadFile(path.c_str()))
    throw InputError("{}: NIfTI by its content, but {}", path.string(),
                     is_gzipped(path) ? "damaged or not named .nii.gz; rename it"
                                      : "damaged or not named .nii; rename it");
  auto stack = std::make_unique<ImageFileStack>(io.GetPointer(), path);
  require_nifti_voxels(path, header);

  std::vector<std::string> warnings;
  if (header.get<std::int16_t>(252) == 0 && header.get<std::int16_t>(254) == 0)
    warnings.push_back(unknown_orientation("neither qform nor sform", stack->orientation()));
  progress.advance();
  return open_image(std::move(stack), "NIfTI", std::move(warnings), options);
}

Scan open_nrrd(const fs::path& path, const ScanOptions& options, Progress& progress) {
  progress.begin("opening", 1, "files");
  const TextHeader header = read_text_header(path, ':', "");
  require_spacing(path, "spacings", numbers(header.get("spacings")));

  const std::optional<StoredVoxels> voxels = nrrd_voxels(path, header);
  auto stack = std::make_unique<ImageFileStack>(itk::NrrdImageIO::New().GetPointer(), path);
  if (voxels) stack->read_from(*voxels);

  std::vector<std::string> warnings;
  if (header.get("space").empty())
    warnings.push_back(unknown_orientation("no `space`", stack->orientation()));
  progress.advance();
  return open_image(std::move(stack), "NRRD", std::move(warnings), options);
}

Scan open_meta_image(const fs::path& path, const ScanOptions& options, Progress& progress) {
  progress.begin("opening", 1, "files");
  const TextHeader header = read_text_header(path, '=', "ElementDataFile");
  require_spacing(path, "ElementSpacing", numbers(header.get("ElementSpacing")));

  auto stack = std::make_unique<ImageFileStack>(itk::MetaImageIO::New().GetPointer(), path);
  const std::string packed = header.get("CompressedData");
  const bool compressed = !packed.empty() && packed != "False";
  const std::vector<double> compressed_B = numbers(header.get("CompressedDataSize"));
  const std::optional<StoredVoxels> voxels = meta_image_voxels(path, header);
  if (voxels && !compressed)
    stack->read_from(*voxels);
  else if (voxels && !compressed_B.empty())
    require_size(*voxels, static_cast<std::int64_t>(compressed_B.front()));
  progress.advance();
  return open_image(std::move(stack), "MetaImage", {}, options);
}

bool is_meta_image(const std::string& leading_bytes) {
  const auto line_end = leading_bytes.find('\n');
  const auto equals = leading_bytes.find('=');
  if (line_end == std::string::npos || equals == std::string::npos || equals > line_end) return false;
  const std::string key = trimmed(leading_bytes.substr(0, equals));
  constexpr std::array kFirstKeys{"ObjectType", "NDims", "Comment", "ObjectSubType", "Name", "ID"};
  return std::ranges::find(kFirstKeys, key) != kFirstKeys.end() &&
         leading_bytes.find("NDims") != std::string::npos;
}

}  // namespace xraycast
