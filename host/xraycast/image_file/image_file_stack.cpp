#include "xraycast/image_file/image_file_stack.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/image_file/raw_voxels.hpp"
#include "xraycast/volume/rescale.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <cmath>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

SliceSource::HuRange rescale_bytes(const char* bytes, const ImageHeader& header, std::span<std::int16_t> hu) {
  return with_voxel_type(header.type, [&]<typename T>(T) {
    return rescale(std::span(reinterpret_cast<const T*>(bytes), hu.size()), header.slope, header.intercept,
                   hu);
  });
}

/// Three sizes, 1 for axes that the header does not have.
std::array<std::int64_t, 3> sizes_of(const ImageHeader& header) {
  std::array<std::int64_t, 3> sizes{1, 1, 1};
  std::copy_n(header.size.begin(), std::min<std::size_t>(3, header.size.size()), sizes.begin());
  return sizes;
}

/// Where the voxels of each file start.
std::int64_t first_B(const PlainVoxels& voxels, std::int64_t file_B) {
  if (voxels.offset_B != PlainVoxels::kAtTheEnd) return voxels.offset_B;
  return std::max(voxels.header_B, static_cast<std::int64_t>(fs::file_size(voxels.files.front())) - file_B);
}

}  // namespace

void swap_bytes(std::span<char> bytes, std::size_t number_B) {
  for (std::size_t i = 0; i + number_B <= bytes.size(); i += number_B)
    std::reverse(bytes.data() + i, bytes.data() + i + number_B);
}

RawVoxels opened(const PlainVoxels& voxels, std::int64_t needed_B) {
  return {voxels.files.front(), first_B(voxels, needed_B), needed_B};
}

std::int64_t bytes_of(VoxelType type) {
  constexpr std::array<std::int64_t, 10> kBytes{1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
  return kBytes[static_cast<std::size_t>(type)];
}

ImageFileStack::ImageFileStack(ImageHeader header, StoredVoxels voxels)
    : header_(std::move(header)), voxels_(std::move(voxels)) {
  name = header_.path.string();
  check_header();
  columns = sizes_of(header_)[0];
  rows = sizes_of(header_)[1];
  slices_ = sizes_of(header_)[2];
  check_files();

  const auto& [i, j, k] = header_.step_mm;
  thickness_mm = glm::length(k);
  reversed_ = glm::dot(k, upward(glm::cross(i, j))) < 0;
  for (std::int64_t s = 0; s < slices_; ++s)
    planes.push_back({header_.origin_mm + static_cast<double>(reversed_ ? slices_ - 1 - s : s) * k, i, j});
}

void ImageFileStack::check_header() const {
  const std::vector<std::int64_t>& size = header_.size;
  for (std::size_t d = 3; d < size.size(); ++d)
    if (size[d] > 1)
      throw InputError("{}: {} dimensions; a scan has three: extract one volume", name, size.size());
  if (header_.numbers_per_voxel != 1)
    throw InputError("{}: {} numbers per voxel (colours or vectors); a CT scan has one: export one channel",
                     name, header_.numbers_per_voxel);
  constexpr std::int64_t kMaxSize = 65536;
  for (std::size_t d = 0; d < size.size(); ++d)
    if (size[d] < 1 || size[d] > kMaxSize)
      throw InputError("{}: {} voxels along axis {} are outside 1 to {}; export the file again", name,
                       size[d], d + 1, kMaxSize);
  // Three dimensions span a volume, two leave the thickness open. Written so that NaN is refused.
  const auto& [i, j, k] = header_.step_mm;
  if (size.size() > 2 &&
      !(std::abs(glm::dot(glm::cross(i, j), k)) > 1e-6 * glm::length(i) * glm::length(j) * glm::length(k)))
    throw InputError("{}: the direction matrix is singular; export the file again with its orientation",
                     name);
}

void ImageFileStack::check_files() {
  const std::int64_t needed_B = slice_B() * slices_;
  if (const auto* packed = std::get_if<PackedVoxels>(&voxels_)) return require_packed(*packed, needed_B);
  if (const auto* loaded = std::get_if<LoadedVoxels>(&voxels_)) {
    if (std::ssize(loaded->bytes) != needed_B)
      throw InputError("{}: {} bytes of voxels instead of {}; export the file again", name,
                       loaded->bytes.size(), needed_B);
    return;
  }
  auto& plain = std::get<PlainVoxels>(voxels_);
  auto& [files, offset_B, header_B] = plain;
  const std::int64_t file_B = needed_B / std::ssize(files);
  offset_B = first_B(plain, file_B);
  for (const fs::path& file : files) RawVoxels(file, offset_B, file_B);
}

void ImageFileStack::read_slice(std::int64_t stored, std::span<char> bytes) const {
  if (unpacked_) {
    std::copy_n(unpacked_.get() + stored * slice_B(), bytes.size(), bytes.begin());
    return;
  }
  if (const auto* loaded = std::get_if<LoadedVoxels>(&voxels_)) {
    std::copy_n(loaded->bytes.data() + stored * slice_B(), bytes.size(), bytes.begin());
    return;
  }
  const auto& [files, offset_B, header_B] = std::get<PlainVoxels>(voxels_);
  const std::int64_t slices_a_file = slices_ / std::ssize(files);
  const RawVoxels voxels(files[static_cast<std::size_t>(stored / slices_a_file)], offset_B,
                         slices_a_file * slice_B());
  voxels.read(stored % slices_a_file * slice_B(), bytes);
}

void ImageFileStack::prepare() {
  if (const auto* packed = std::get_if<PackedVoxels>(&voxels_); packed && !unpacked_)
    unpacked_ = inflate_voxels(*packed, slice_B() * slices_);
}

SliceSource::HuRange ImageFileStack::decode_slice(std::int64_t slice, std::span<std::int16_t> hu) const {
  const std::int64_t voxel_B = bytes_of(header_.type);
  // 16-bit voxels become HU where they are.
  std::vector<char> wider(voxel_B == sizeof(std::int16_t) ? 0 : static_cast<std::size_t>(slice_B()));
  const std::span bytes =
      wider.empty() ? std::span(reinterpret_cast<char*>(hu.data()), hu.size_bytes()) : std::span(wider);
  read_slice(reversed_ ? slices_ - 1 - slice : slice, bytes);
  if (voxel_B > 1 && header_.is_big_endian == (std::endian::native == std::endian::little))
    swap_bytes(bytes, static_cast<std::size_t>(voxel_B));
  return rescale_bytes(bytes.data(), header_, hu);
}

std::string orientation_of(const ImageHeader& header) {
  const auto& [i, j, k] = header.step_mm;
  return {side(i), side(j), glm::length(k) > 0 ? side(k) : side(glm::cross(i, j))};
}

std::string unknown_orientation(const std::string& fault, const ImageHeader& header) {
  return fmt::format("the file does not state the patient's orientation ({}); its axes are taken as {}",
                     fault, orientation_of(header));
}

Scan deliver_image(ImageFile file, const char* format, const ScanOptions& options) {
  ImageHeader& header = file.header;
  ScanInfo info;
  info.format = format;
  info.orientation = orientation_of(header);
  info.warnings = std::move(file.warnings);
  if (bytes_of(header.type) == 1 && header.slope == 1 && header.intercept == 0)
    info.notes.emplace_back(kEightBitNote);
  header.intercept += options.offset_hu;
  auto stack = std::make_unique<ImageFileStack>(std::move(header), std::move(file.voxels));
  return deliver(std::move(stack), std::move(info), options);
}

fs::path data_file_beside(const fs::path& header, const std::string& name) {
  fs::path file = header.parent_path() / name;
  std::error_code error;
  // A pipe or a device could go on for ever.
  if (!fs::is_regular_file(file, error))
    throw InputError("{}: its data file {} is missing; put it beside the header", header.string(),
                     excerpt(name));
  return file;
}

void require_spacing(const fs::path& path, const char* field, std::span<const double> spacing_mm) {
  for (const double mm : spacing_mm)
    if (!std::isfinite(mm) || mm <= 0)
      throw InputError("{}: {} holds {}; spacing must be finite and above zero", path.string(), field, mm);
}

}  // namespace xraycast
