#include "xraycast/series/genesis_scan.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/volume/rescale.hpp"
#include "xraycast/volume/slice_stack.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <fstream>
#include <optional>
#include <type_traits>

// The layout is that of ITK's Ge5xHdr.h and MIPAV's FileGESigna5X.java.
namespace xraycast {
namespace {

namespace fs = std::filesystem;

/// The offset from a stored value to HU.
constexpr double kGenesisIntercept = -1024;

/// A Genesis file's numbers, by their byte offset.
class GenesisFile {
 public:
  explicit GenesisFile(const fs::path& path) : path_(path), stream_(path, std::ios::binary) {
    if (!stream_) throw InputError("{}: cannot be read; check its permissions", path.string());
    stream_.seekg(0, std::ios::end);
    size_B_ = stream_.tellg();
  }

  std::int64_t size_B() const { return size_B_; }

  template <typename T>
  T get(std::int64_t offset_B) {
    std::conditional_t<sizeof(T) == 2, std::uint16_t, std::uint32_t> bits = 0;
    stream_.seekg(offset_B);
    for (std::size_t i = 0; i < sizeof(T); ++i)
      bits = static_cast<decltype(bits)>(bits << 8 | static_cast<unsigned char>(stream_.get()));
    if (!stream_) throw DamagedSlice("{}: truncated within its header; copy the file again", path_.string());
    return std::bit_cast<T>(bits);
  }

 private:
  fs::path path_;
  std::ifstream stream_;
  std::int64_t size_B_ = 0;
};

struct GenesisSlice {
  fs::path file;
  std::int64_t columns = 0, rows = 0, pixels_B = 0;
  SlicePlane plane;
  double thickness_mm = 0;
};

/// The offsets of the fields of an image header; version 2 aligns them to four bytes.
struct ImageHeaderLayout {
  std::int64_t pixel_size, location, centre;
};
constexpr ImageHeaderLayout kPacked{50, 126, 130}, kVersion2{52, 132, 136};
constexpr std::int64_t kVersion2ImageHeader = 2308;

GenesisSlice read_header(const fs::path& path) {
  GenesisFile file(path);
  GenesisSlice slice;
  slice.file = path;
  slice.columns = file.get<std::int32_t>(8);
  slice.rows = file.get<std::int32_t>(12);
  if (slice.columns < 1 || slice.rows < 1 || slice.columns > 65536 || slice.rows > 65536)
    throw DamagedSlice("{}: width x height of {} x {} is outside 1 to 65536; copy the file again",
                       path.string(), slice.columns, slice.rows);
  if (const auto bits = file.get<std::int32_t>(16); bits != 16)
    throw InputError("{}: {} bits per pixel; only 16 are supported; export the slices again", path.string(),
                     bits);
  if (const auto compression = file.get<std::int32_t>(20); compression != 0 && compression != 1)
    throw InputError("{}: compression {} is not supported; convert it to uncompressed slices", path.string(),
                     compression);

  const std::int64_t pixel_bytes = slice.columns * slice.rows * 2;
  slice.pixels_B = file.get<std::int32_t>(4);
  // Some copies have lost the pointer; the pixels end the file.
  if (slice.pixels_B < 156 || slice.pixels_B > file.size_B()) slice.pixels_B = file.size_B() - pixel_bytes;
  if (slice.pixels_B < 0 || slice.pixels_B + pixel_bytes > file.size_B())
    throw DamagedSlice("{}: truncated, {} bytes of pixels do not fit in {}; copy the file again",
                       path.string(), pixel_bytes, file.size_B());

  const bool version2 = file.get<std::int16_t>(52) == 2;
  std::int64_t header = file.get<std::int32_t>(148);
  if (version2 && header <= 0) header = kVersion2ImageHeader;
  if (header <= 0 || header >= file.size_B())
    throw DamagedSlice("{}: the pointer to the image header, {}, lies outside the file; copy it again",
                       path.string(), header);

  const ImageHeaderLayout& at = version2 ? kVersion2 : kPacked;
  const double x_mm = file.get<float>(header + at.pixel_size),
               y_mm = file.get<float>(header + at.pixel_size + 4);
  const double location_mm = file.get<float>(header + at.location);
  const double right_mm = file.get<float>(header + at.centre),
               anterior_mm = file.get<float>(header + at.centre + 4);
  if (!(x_mm > 0 && y_mm > 0 && std::isfinite(x_mm) && std::isfinite(y_mm)))
    throw DamagedSlice("{}: pixel size {} x {} mm must be finite and above zero; copy the file again",
                       path.string(), x_mm, y_mm);
  if (!std::isfinite(location_mm) || !std::isfinite(right_mm) || !std::isfinite(anterior_mm))
    throw DamagedSlice("{}: the slice's location or centre is not a number; copy the file again",
                       path.string());
  slice.thickness_mm = file.get<float>(header + 26);
  const glm::dvec3 centre_mm(-right_mm, -anterior_mm, location_mm);
  const glm::dvec3 i(x_mm, 0, 0), j(0, y_mm, 0);
  slice.plane = {centre_mm - 0.5 * static_cast<double>(slice.columns - 1) * i -
                     0.5 * static_cast<double>(slice.rows - 1) * j,
                 i, j};
  return slice;
}

class GenesisStack final : public SliceStack {
 public:
  GenesisStack(std::vector<GenesisSlice> slices, double offset_hu)
      : slices_(std::move(slices)), offset_hu_(offset_hu) {
    columns = slices_.front().columns;
    rows = slices_.front().rows;
    thickness_mm = slices_.front().thickness_mm;
    for (const GenesisSlice& slice : slices_) planes.push_back(slice.plane);
  }

 private:
  SliceSource::HuRange decode_slice(std::int64_t index, std::span<std::int16_t> hu) const override {
    const GenesisSlice& slice = slices_[static_cast<std::size_t>(index)];
    std::ifstream stream(slice.file, std::ios::binary);
    stream.seekg(slice.pixels_B);
    stream.read(reinterpret_cast<char*>(hu.data()), static_cast<std::streamsize>(hu.size_bytes()));
    if (!stream) throw InputError("{}: could not be read completely; copy it again", slice.file.string());
    const std::span<std::uint16_t> words(reinterpret_cast<std::uint16_t*>(hu.data()), hu.size());
    for (std::uint16_t& word : words) word = static_cast<std::uint16_t>(word << 8 | word >> 8);
    return rescale(std::span<const std::uint16_t>(words), 1, kGenesisIntercept + offset_hu_, hu);
  }

  std::vector<GenesisSlice> slices_;
  double offset_hu_;
};

void require_equal_sizes(const std::vector<GenesisSlice>& slices) {
  const GenesisSlice& first = slices.front();
  for (const GenesisSlice& slice : slices)
    if (slice.columns != first.columns || slice.rows != first.rows)
      throw InputError("{}: {} x {} pixels, but {} has {} x {}; remove one of them", slice.file.string(),
                       slice.columns, slice.rows, first.file.string(), first.columns, first.rows);
}

void sort_by_location(std::vector<GenesisSlice>& slices, ScanInfo& info) {
  const auto location_mm = [](const GenesisSlice& slice) { return slice.plane.origin_mm.z; };
  std::ranges::stable_sort(slices, {}, location_mm);
  std::string dropped;
  std::vector<GenesisSlice> kept;
  for (GenesisSlice& slice : slices) {
    // Locations are floats of up to thousands of millimetres, good to a thousandth.
    if (!kept.empty() && location_mm(slice) - location_mm(kept.back()) < 1e-3)
      dropped += (dropped.empty() ? "" : ", ") + slice.file.filename().string();
    else
      kept.push_back(std::move(slice));
  }
  info.left_out.same_place = std::ssize(slices) - std::ssize(kept);
  slices = std::move(kept);
  if (!dropped.empty())
    info.notes.push_back("left out, because another slice has the same position: " + dropped);
}

}  // namespace

Scan open_genesis(const fs::path& path, const std::vector<fs::path>& files, const ScanOptions& options,
                  Progress& progress) {
  progress.begin("opening", std::ssize(files), "files");
  std::vector<std::optional<GenesisSlice>> headers(files.size());
  std::vector<std::string> faults(files.size());
  parallel_for(std::ssize(files), [&](std::int64_t i) {
    const auto index = static_cast<std::size_t>(i);
    try {
      headers[index] = read_header(files[index]);
    } catch (const DamagedSlice& error) {
      if (!options.skip_damaged) throw;
      faults[index] = error.what();
    }
    progress.advance();
  });

  ScanInfo info;
  info.format = "GE Genesis";
  std::vector<GenesisSlice> slices;
  for (std::size_t i = 0; i < files.size(); ++i)
    if (headers[i])
      slices.push_back(std::move(*headers[i]));
    else
      info.leave_out(faults[i]);
  if (slices.empty()) throw InputError("{}: all slices are damaged; copy them again", path.string());
  info.orientation = "LPS";
  require_equal_sizes(slices);
  sort_by_location(slices, info);
  auto stack = std::make_unique<GenesisStack>(std::move(slices), options.offset_hu);
  stack->name = path.string();
  return deliver(std::move(stack), std::move(info), options);
}

}  // namespace xraycast
