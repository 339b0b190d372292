#include "xraycast/scan/dicom_scan.hpp"

#include "xraycast/base/child_process.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/scan/dicom_series.hpp"
#include "xraycast/scan/dicom_slice.hpp"
#include "xraycast/scan/rescale.hpp"
#include "xraycast/scan/slice_stack.hpp"

#include <gdcmImageReader.h>
#include <gdcmTrace.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <new>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

// ---- pixels --------------------------------------------------------------------------------------

/// Bits above the high bit may hold anything (old scanners put overlays there): shifts them out, and with the
/// way back extends the sign.
template <typename T>
void keep_stored_bits(const DicomSlice& slice, std::span<T> words) {
  const int up = 15 - slice.high_bit, down = 16 - slice.bits_stored;
  for (T& word : words) word = static_cast<T>(static_cast<T>(word << up) >> down);
}

/// Reads directly into the slice's memory and rescales it there.
SliceSource::HuRange read_plain(const DicomSlice& slice, std::span<std::int16_t> hu) {
  std::ifstream stream(slice.file, std::ios::binary);
  stream.seekg(*slice.plain_pixels_B);
  stream.read(reinterpret_cast<char*>(hu.data()), static_cast<std::streamsize>(hu.size_bytes()));
  if (!stream) throw DamagedSlice("{}: could not be read completely; copy it again", slice.file.string());

  const auto rescale_as = [&]<typename T>(T) {
    const std::span<T> words(reinterpret_cast<T*>(hu.data()), hu.size());
    keep_stored_bits(slice, words);
    return rescale(std::span<const T>(words), slice.slope, slice.intercept, hu);
  };
  return slice.is_signed ? rescale_as(std::int16_t{}) : rescale_as(std::uint16_t{});
}

SliceSource::HuRange rescale_decoded(const DicomSlice& slice, const gdcm::Image& image,
                                     std::span<std::int16_t> hu) {
  std::vector<char> buffer(image.GetBufferLength());
  if (!image.GetBuffer(buffer.data()))
    throw DamagedSlice("{}: its {} data could not be decoded; the file is damaged or its compression unknown",
                       slice.file.string(), slice.coding);
  const auto rescale_as = [&]<typename T>(T) {
    if (buffer.size() < hu.size() * sizeof(T))
      throw DamagedSlice("{}: truncated, {} of {} bytes of pixel data are there; copy the file again",
                         slice.file.string(), buffer.size(), hu.size() * sizeof(T));
    return rescale(std::span(reinterpret_cast<const T*>(buffer.data()), hu.size()), slice.slope,
                   slice.intercept, hu);
  };
  switch (image.GetPixelFormat().GetScalarType()) {
    case gdcm::PixelFormat::UINT8:
      return rescale_as(std::uint8_t{});
    case gdcm::PixelFormat::INT8:
      return rescale_as(std::int8_t{});
    case gdcm::PixelFormat::UINT12:
    case gdcm::PixelFormat::UINT16:
      return rescale_as(std::uint16_t{});
    case gdcm::PixelFormat::INT12:
    case gdcm::PixelFormat::INT16:
      return rescale_as(std::int16_t{});
    case gdcm::PixelFormat::UINT32:
      return rescale_as(std::uint32_t{});
    case gdcm::PixelFormat::INT32:
      return rescale_as(std::int32_t{});
    default:
      throw InputError("{}: pixels of type {} are not supported", slice.file.string(),
                       image.GetPixelFormat().GetScalarTypeAsString());
  }
}

SliceSource::HuRange decode_by_gdcm(const DicomSlice& slice, std::span<std::int16_t> hu) {
  gdcm::ImageReader reader;
  reader.SetFileName(slice.file.c_str());
  if (!reader.Read())
    throw DamagedSlice("{}: its {} data could not be decoded; the file is damaged or its compression unknown",
                       slice.file.string(), slice.coding);
  return rescale_decoded(slice, reader.GetImage(), hu);
}

/// The result of the process that decodes a slice, followed by its HU.
struct DecodedSlice {
  SliceSource::HuRange range;
  std::array<char, 1000> error;  ///< error message, zero-terminated
};

/// GDCM and the codecs under it write past their memory for some damaged files, or abort.
SliceSource::HuRange read_by_gdcm(const DicomSlice& slice, std::span<std::int16_t> hu) {
  const SharedMemory shared(sizeof(DecodedSlice) + hu.size_bytes());
  auto* const decoded = new (shared.bytes().data()) DecodedSlice{};
  auto* const shared_hu = reinterpret_cast<std::int16_t*>(shared.bytes().data() + sizeof(DecodedSlice));
  // A codec holds a slice several times, in wider words.
  constexpr std::int64_t kCopies = 32, kLibraries_B = std::int64_t{256} << 20;
  const ChildLimits limits{.memory_B = kCopies * static_cast<std::int64_t>(hu.size_bytes()) + kLibraries_B};
  const bool ended_well = run_in_child(
      [&] {
        try {
          decoded->range = decode_by_gdcm(slice, {shared_hu, hu.size()});
        } catch (const InputError& error) {
          std::string(error.what()).copy(decoded->error.data(), decoded->error.size() - 1);
        }
      },
      limits);
  if (decoded->error[0] != 0) throw DamagedSlice("{}", decoded->error.data());
  if (!ended_well)
    throw DamagedSlice("{}: its {} data are damaged; copy it again or remove it", slice.file.string(),
                       slice.coding);
  std::copy_n(shared_hu, hu.size(), hu.begin());
  return decoded->range;
}

class DicomStack final : public SliceStack {
 public:
  explicit DicomStack(std::vector<DicomSlice> slices) : slices_(std::move(slices)) {
    columns = slices_.front().columns;
    rows = slices_.front().rows;
    thickness_mm = slices_.front().thickness_mm;
    for (const DicomSlice& slice : slices_) planes.push_back(slice.plane);
  }

 private:
  SliceSource::HuRange decode_slice(std::int64_t index, std::span<std::int16_t> hu) const override {
    const DicomSlice& slice = slices_[static_cast<std::size_t>(index)];
    return slice.plain_pixels_B ? read_plain(slice, hu) : read_by_gdcm(slice, hu);
  }

  std::vector<DicomSlice> slices_;
};

// ---- a series' slices ------------------------------------------------------------------------------

void leave_out(const std::string& fault, ScanInfo& info) { info.warnings.push_back("left out " + fault); }

/// Slices that GDCM must decode are decoded once, to find those that it cannot.
std::vector<DicomSlice> decodable(std::vector<DicomSlice> slices, ScanInfo& info, Progress& progress) {
  std::vector<std::string> faults(slices.size());
  parallel_for(std::ssize(slices), [&](std::int64_t i) {
    progress.check();
    const DicomSlice& slice = slices[static_cast<std::size_t>(i)];
    if (slice.plain_pixels_B) return;
    std::vector<std::int16_t> hu(static_cast<std::size_t>(slice.columns * slice.rows));
    try {
      read_by_gdcm(slice, hu);
    } catch (const DamagedSlice& error) {
      faults[static_cast<std::size_t>(i)] = error.what();
    }
  });
  std::vector<DicomSlice> good;
  for (std::size_t i = 0; i < slices.size(); ++i)
    if (faults[i].empty())
      good.push_back(std::move(slices[i]));
    else
      leave_out(faults[i], info);
  return good;
}

std::vector<DicomSlice> usable_slices(const DicomSeries& series, const fs::path& path, bool skip_damaged,
                                      ScanInfo& info, Progress& progress) {
  std::vector<DicomSlice> slices;
  for (const DicomFileSummary& file : series.files)
    if (file.slice)
      slices.push_back(*file.slice);
    else if (!file.is_damaged)
      throw InputError("{}", file.fault);
    else if (!skip_damaged)
      throw DamagedSlice("{}", file.fault);
    else
      leave_out(file.fault, info);
  if (skip_damaged) slices = decodable(std::move(slices), info, progress);
  if (slices.empty())
    throw InputError("{}: all slices of the series are damaged; copy it again", path.string());
  return slices;
}

void require_equal_slices(const std::vector<DicomSlice>& series) {
  const DicomSlice& first = series.front();
  for (const DicomSlice& slice : series) {
    if (slice.columns != first.columns || slice.rows != first.rows)
      throw InputError(
          "{}: {} x {} pixels, but {} of the same series has {} x {} (Rows, Columns); remove one of them",
          slice.file.string(), slice.columns, slice.rows, first.file.string(), first.columns, first.rows);
    const auto turned = [](const glm::dvec3& a, const glm::dvec3& b) {
      return glm::distance(glm::normalize(a), glm::normalize(b)) > 1e-3;
    };
    if (turned(slice.plane.i_step_mm, first.plane.i_step_mm) ||
        turned(slice.plane.j_step_mm, first.plane.j_step_mm))
      throw InputError(
          "{}: ImageOrientationPatient (0020,0037) differs from that of {} in the same series; remove the "
          "localizer or the slices of the other orientation",
          slice.file.string(), first.file.string());
  }
}

void sort_by_position(std::vector<DicomSlice>& series, ScanInfo& info) {
  const glm::dvec3 normal = upward(glm::cross(glm::normalize(series.front().plane.i_step_mm),
                                              glm::normalize(series.front().plane.j_step_mm)));
  const auto height_mm = [&](const DicomSlice& slice) { return glm::dot(slice.plane.origin_mm, normal); };
  std::ranges::stable_sort(series, {}, height_mm);

  // Positions are printed to a thousandth of a millimetre or finer.
  const auto same = [&](const DicomSlice& a, const DicomSlice& b) {
    return height_mm(b) - height_mm(a) < 1e-3;
  };
  const std::size_t before = series.size();
  series.erase(std::unique(series.begin(), series.end(), same), series.end());
  if (series.size() < before)
    info.warnings.push_back(
        fmt::format("{} left out at a position that the series already has; it may hold several phases or "
                    "reconstructions",
                    pluralize(before - series.size(), "slice")));
}

}  // namespace

Scan open_dicom(const fs::path& path, const std::vector<fs::path>& files, const ScanOptions& options,
                Progress& progress) {
  gdcm::Trace::DebugOff();
  gdcm::Trace::WarningOff();
  gdcm::Trace::ErrorOff();

  progress.begin("opening", std::ssize(files), "files");
  std::vector<DicomFileSummary> summaries(files.size());
  parallel_for(std::ssize(files), [&](std::int64_t i) {
    summaries[static_cast<std::size_t>(i)] = summarise_dicom(files[static_cast<std::size_t>(i)]);
    progress.advance();
  });

  ScanInfo info;
  info.format = "DICOM";
  const DicomSeries series = choose_series(std::move(summaries), options.series, path, info);
  info.modality = series.files.front().modality;
  if (info.modality != "CT")
    info.warnings.push_back(fmt::format("modality {} is not CT, so its values are not Hounsfield units",
                                        info.modality.empty() ? "unknown" : info.modality));
  std::vector<DicomSlice> slices = usable_slices(series, path, options.skip_damaged, info, progress);
  require_equal_slices(slices);
  sort_by_position(slices, info);

  const SlicePlane& plane = slices.front().plane;
  info.orientation = {side(plane.i_step_mm), side(plane.j_step_mm),
                      side(upward(glm::cross(plane.i_step_mm, plane.j_step_mm)))};
  auto stack = std::make_unique<DicomStack>(std::move(slices));
  stack->name = path.string();
  return deliver(std::move(stack), std::move(info), options);
}

bool is_dicom_directory(const fs::path& file) { return summarise_dicom(file).is_directory; }

}  // namespace xraycast
