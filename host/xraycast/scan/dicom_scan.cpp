#include "xraycast/scan/dicom_scan.hpp"

#include "xraycast/base/child_process.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/parallel.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/scan/dicom_header.hpp"
#include "xraycast/scan/rescale.hpp"
#include "xraycast/scan/slice_stack.hpp"

#include <gdcmImageReader.h>
#include <gdcmTrace.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <map>
#include <new>
#include <optional>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

constexpr DicomTag kModality = 0x00080060, kSeriesDescription = 0x0008103e, kSliceThickness = 0x00180050,
                   kSeriesUid = 0x0020000e, kSeriesNumber = 0x00200011, kImagePosition = 0x00200032,
                   kImageOrientation = 0x00200037, kSamplesPerPixel = 0x00280002,
                   kNumberOfFrames = 0x00280008, kRows = 0x00280010, kColumns = 0x00280011,
                   kPixelSpacing = 0x00280030, kBitsAllocated = 0x00280100, kBitsStored = 0x00280101,
                   kHighBit = 0x00280102, kPixelRepresentation = 0x00280103, kRescaleIntercept = 0x00281052,
                   kRescaleSlope = 0x00281053;

/// One file's header.
struct DicomSlice {
  fs::path file;
  std::string modality, series_uid, series_description, series_number;
  std::int64_t columns = 0, rows = 0;
  SlicePlane plane;
  double thickness_mm = 0, slope = 1, intercept = 0;
  int bits_stored = 16, high_bit = 15;
  bool is_signed = false;
  /// Where the pixels start if they are plain 16-bit little-endian words; otherwise GDCM decodes them.
  std::optional<std::int64_t> plain_pixels_B;
  const char* coding = "";  ///< what GDCM has to decode, for messages
};

// ---- one file's header ---------------------------------------------------------------------------

std::vector<double> numbers(const DicomHeader& header, DicomTag tag, std::size_t count, const fs::path& file,
                            const char* name, const char* consequence) {
  std::vector<double> result = header.numbers(tag);
  if (result.size() != count || !std::ranges::all_of(result, [](double x) { return std::isfinite(x); }))
    throw InputError("{}: {} ({:04x},{:04x}) is missing or damaged, so {}; export the series again with it",
                     file.string(), name, tag >> 16, tag & 0xffff, consequence);
  return result;
}

/// How the pixels of a transfer syntax are coded.
const char* coding_of(const std::string& transfer_syntax) {
  // DICOM PS3.6, annex A: the numbers behind 1.2.840.10008.1.2, of which the last ones choose a profile.
  struct Coding {
    const char *prefix, *name;
  };
  constexpr Coding kCodings[] = {{"1.2.840.10008.1.2.4.5", "JPEG"},
                                 {"1.2.840.10008.1.2.4.7", "JPEG"},
                                 {"1.2.840.10008.1.2.4.8", "JPEG-LS"},
                                 {"1.2.840.10008.1.2.4.9", "JPEG 2000"},
                                 {"1.2.840.10008.1.2.5", "RLE"}};
  for (const auto& [prefix, name] : kCodings)
    if (transfer_syntax.starts_with(prefix)) return name;
  return "pixel";
}

/// What turns stored values into Hounsfield units. A CT slice has to say it (Type 1 of CT Image Storage):
/// taken as 1 and 0, most would be off by 1024 HU.
double rescale_number(const DicomHeader& header, DicomTag tag, const char* name, double of_others,
                      const fs::path& file) {
  const std::string text = header.text(tag);
  if (text.empty() && header.text(kModality) != "CT") return of_others;
  const std::vector<double> number = header.numbers(tag);
  if (number.size() != 1 || !std::isfinite(number[0]) || (tag == kRescaleSlope && number[0] == 0))
    throw InputError(
        "{}: {} ({:04x},{:04x}) is {}, so its Hounsfield units are unknown; export the series again",
        file.string(), name, tag >> 16, tag & 0xffff, text.empty() ? "missing" : "'" + text + "'");
  return number[0];
}

double number_or(const DicomHeader& header, DicomTag tag, double fallback) {
  const std::vector<double> result = header.numbers(tag);
  return result.empty() ? fallback : result.front();
}

SlicePlane read_plane(const DicomHeader& header, const fs::path& file) {
  const auto position =
      numbers(header, kImagePosition, 3, file, "ImagePositionPatient", "its place is unknown");
  const auto directions =
      numbers(header, kImageOrientation, 6, file, "ImageOrientationPatient", "left and right are unknown");
  const auto spacing = numbers(header, kPixelSpacing, 2, file, "PixelSpacing", "its size is unknown");
  if (!(spacing[0] > 0 && spacing[1] > 0))
    throw InputError("{}: PixelSpacing (0028,0030) is {} x {} mm; it has to be above zero", file.string(),
                     spacing[0], spacing[1]);
  const glm::dvec3 i(directions[0], directions[1], directions[2]),
      j(directions[3], directions[4], directions[5]);
  // Printed cosines are unit vectors but for their last digit.
  if (std::abs(glm::length(i) - 1) > 0.01 || std::abs(glm::length(j) - 1) > 0.01 ||
      std::abs(glm::dot(i, j)) > 0.01)
    throw InputError("{}: ImageOrientationPatient (0020,0037) is not two perpendicular unit vectors",
                     file.string());
  // The first spacing is the distance between rows.
  return {{position[0], position[1], position[2]},
          glm::normalize(i) * spacing[1],
          glm::normalize(j) * spacing[0]};
}

/// Nothing for a DICOM file that holds no image.
std::optional<DicomSlice> read_slice_header(const fs::path& file) {
  const DicomHeader header(file);
  DicomSlice slice;
  slice.file = file;
  slice.columns = header.unsigned_short(kColumns).value_or(0);
  slice.rows = header.unsigned_short(kRows).value_or(0);
  if (slice.columns == 0 || slice.rows == 0) return std::nullopt;
  if (!header.pixel_data())
    throw InputError("{}: truncated, it ends before its pixel data; copy the file again", file.string());
  if (header.unsigned_short(kSamplesPerPixel).value_or(1) != 1)
    throw InputError("{}: a colour image (SamplesPerPixel (0028,0002) is not 1); a CT slice is grey",
                     file.string());
  if (number_or(header, kNumberOfFrames, 1) > 1)
    throw InputError(
        "{}: several frames in one file (NumberOfFrames (0028,0008)); convert it to one file a slice or "
        "to NIfTI",
        file.string());

  slice.modality = header.text(kModality);
  slice.series_uid = header.text(kSeriesUid);
  slice.series_description = header.text(kSeriesDescription);
  slice.series_number = header.text(kSeriesNumber);
  slice.plane = read_plane(header, file);
  slice.thickness_mm = number_or(header, kSliceThickness, 0);
  slice.slope = rescale_number(header, kRescaleSlope, "RescaleSlope", 1, file);
  slice.intercept = rescale_number(header, kRescaleIntercept, "RescaleIntercept", 0, file);
  slice.coding = coding_of(header.transfer_syntax());
  const int bits_allocated = header.unsigned_short(kBitsAllocated).value_or(16);
  slice.bits_stored = header.unsigned_short(kBitsStored).value_or(static_cast<std::uint16_t>(bits_allocated));
  slice.high_bit =
      header.unsigned_short(kHighBit).value_or(static_cast<std::uint16_t>(slice.bits_stored - 1));
  slice.is_signed = header.unsigned_short(kPixelRepresentation).value_or(0) == 1;

  const DicomHeader::PixelData& pixels = *header.pixel_data();
  const std::int64_t needed_B = slice.columns * slice.rows * bits_allocated / 8;
  if (!pixels.encapsulated && pixels.length_B < needed_B)
    throw InputError("{}: truncated, {} of {} bytes of pixel data are there; copy the file again",
                     file.string(), pixels.length_B, needed_B);
  // The best a codec does is an empty slice of 512 x 512 pixels in some 100 bytes.
  constexpr std::int64_t kMaxPacked = 20000;
  if (pixels.encapsulated && needed_B / kMaxPacked > pixels.length_B)
    throw InputError(
        "{}: {} x {} pixels (Columns, Rows) cannot come from {} bytes of {} data; copy the file again",
        file.string(), slice.columns, slice.rows, pixels.length_B, slice.coding);
  const bool little_endian =
      header.transfer_syntax() == "1.2.840.10008.1.2" || header.transfer_syntax() == "1.2.840.10008.1.2.1";
  if (little_endian && !pixels.encapsulated && bits_allocated == 16 && slice.high_bit < 16 &&
      slice.bits_stored > 0 && slice.bits_stored <= slice.high_bit + 1)
    slice.plain_pixels_B = pixels.offset_B;
  return slice;
}

// ---- pixels --------------------------------------------------------------------------------------

/// Bits above the high bit may hold anything (old scanners put overlays there): shifts them out, and with the
/// way back extends the sign.
template <typename T>
void keep_stored_bits(const DicomSlice& slice, std::span<T> words) {
  const int up = 15 - slice.high_bit, down = 16 - slice.bits_stored;
  for (T& word : words) word = static_cast<T>(static_cast<T>(word << up) >> down);
}

/// Reads straight into the slice's own memory and rescales it there.
SliceSource::HuRange read_plain(const DicomSlice& slice, std::span<std::int16_t> hu) {
  std::ifstream stream(slice.file, std::ios::binary);
  stream.seekg(*slice.plain_pixels_B);
  stream.read(reinterpret_cast<char*>(hu.data()), static_cast<std::streamsize>(hu.size_bytes()));
  if (!stream) throw InputError("{}: could not be read to its end", slice.file.string());

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
    throw InputError("{}: its {} data could not be decoded; the file is damaged or its compression unknown",
                     slice.file.string(), slice.coding);
  const auto rescale_as = [&]<typename T>(T) {
    if (buffer.size() < hu.size() * sizeof(T))
      throw InputError("{}: truncated, {} of {} bytes of pixel data are there; copy the file again",
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
    throw InputError("{}: its {} data could not be decoded; the file is damaged or its compression unknown",
                     slice.file.string(), slice.coding);
  return rescale_decoded(slice, reader.GetImage(), hu);
}

/// What the process that decodes a slice leaves, in front of its HU.
struct DecodedSlice {
  SliceSource::HuRange range;
  std::array<char, 1000> error;  ///< why it could not, ended by a zero
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
  if (decoded->error[0] != 0) throw InputError("{}", decoded->error.data());
  if (!ended_well)
    throw InputError("{}: its {} data are damaged; copy it again or take it away", slice.file.string(),
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

  SliceSource::HuRange decode(std::int64_t first, std::span<std::int16_t* const> destinations) override {
    std::vector<SliceSource::HuRange> ranges(destinations.size());
    parallel_for(std::ssize(destinations), [&](std::int64_t i) {
      const DicomSlice& slice = slices_[static_cast<std::size_t>(first + i)];
      const std::span hu(destinations[static_cast<std::size_t>(i)], static_cast<std::size_t>(columns * rows));
      ranges[static_cast<std::size_t>(i)] =
          slice.plain_pixels_B ? read_plain(slice, hu) : read_by_gdcm(slice, hu);
    });
    SliceSource::HuRange range = kNoHu;
    for (const auto& other : ranges) include(range, other);
    return range;
  }

 private:
  std::vector<DicomSlice> slices_;
};

// ---- series --------------------------------------------------------------------------------------

using Series = std::vector<DicomSlice>;

std::string describe(const Series& series) {
  const DicomSlice& slice = series.front();
  return fmt::format("{}{}{}, UID {}", slice.series_number.empty() ? "" : slice.series_number + ": ",
                     slice.series_description.empty() ? "" : slice.series_description + ", ",
                     pluralize(series.size(), "slice"),
                     slice.series_uid.empty() ? "unknown" : slice.series_uid);
}

bool matches(const DicomSlice& slice, const std::string& wanted) {
  return slice.series_number == wanted || slice.series_uid.find(wanted) != std::string::npos ||
         slice.series_description.find(wanted) != std::string::npos;
}

/// The series asked for, or the largest one with a warning if there are more.
Series choose(std::vector<Series> all, const std::string& wanted, const std::string& name, ScanInfo& info) {
  std::ranges::stable_sort(all, std::greater{}, [](const Series& series) { return series.size(); });
  std::string list;
  for (const Series& series : all) list += (list.empty() ? "" : "; ") + describe(series);

  auto chosen = all.begin();
  if (!wanted.empty()) {
    const auto fits = [&](const Series& series) { return matches(series.front(), wanted); };
    // A number in full beats the same digits somewhere in a UID.
    const auto exact = [&](const Series& series) { return series.front().series_number == wanted; };
    chosen = std::ranges::find_if(all, exact);
    if (chosen == all.end()) {
      chosen = std::ranges::find_if(all, fits);
      if (chosen == all.end())
        throw InputError("{}: no series matches '{}'; it holds {}", name, wanted, list);
      if (std::ranges::count_if(all, fits) > 1)
        throw InputError("{}: several series match '{}'; it holds {}", name, wanted, list);
    }
  } else if (all.size() > 1) {
    info.warnings.push_back(
        fmt::format("{} series in the folder, the largest was taken; choose another series by its number, "
                    "description or UID: {}",
                    all.size(), list));
  }
  for (auto series = all.begin(); series != all.end(); ++series)
    if (series != chosen) info.other_series.push_back(describe(*series));
  return std::move(*chosen);
}

void require_equal_slices(const Series& series) {
  const DicomSlice& first = series.front();
  for (const DicomSlice& slice : series) {
    if (slice.columns != first.columns || slice.rows != first.rows)
      throw InputError(
          "{}: {} x {} pixels, but {} of the same series has {} x {} (Rows, Columns); take one of them away",
          slice.file.string(), slice.columns, slice.rows, first.file.string(), first.columns, first.rows);
    const auto turned = [](const glm::dvec3& a, const glm::dvec3& b) {
      return glm::distance(glm::normalize(a), glm::normalize(b)) > 1e-3;
    };
    if (turned(slice.plane.i_step_mm, first.plane.i_step_mm) ||
        turned(slice.plane.j_step_mm, first.plane.j_step_mm))
      throw InputError(
          "{}: ImageOrientationPatient (0020,0037) differs from that of {} in the same series; take the "
          "localizer or the other orientation away",
          slice.file.string(), first.file.string());
  }
}

void sort_by_position(Series& series, ScanInfo& info) {
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
        fmt::format("{} dropped for lying where the series already has one; it may hold "
                    "several phases or reconstructions",
                    pluralize(before - series.size(), "slice")));
}

}  // namespace

Scan open_dicom(const fs::path& path, const std::vector<fs::path>& files, const ScanOptions& options,
                Progress& progress) {
  gdcm::Trace::DebugOff();
  gdcm::Trace::WarningOff();
  gdcm::Trace::ErrorOff();

  progress.begin("opening", std::ssize(files), "files");
  std::vector<std::optional<DicomSlice>> headers(files.size());
  parallel_for(std::ssize(files), [&](std::int64_t i) {
    headers[static_cast<std::size_t>(i)] = read_slice_header(files[static_cast<std::size_t>(i)]);
    progress.advance();
  });

  std::map<std::string, Series> by_uid;
  for (auto& header : headers)
    if (header) by_uid[header->series_uid].push_back(std::move(*header));
  if (by_uid.empty()) throw InputError("{}: the DICOM files hold no images", path.string());

  ScanInfo info;
  info.format = "DICOM";
  std::vector<Series> all;
  for (auto& [uid, series] : by_uid) all.push_back(std::move(series));
  Series series = choose(std::move(all), options.series, path.string(), info);
  info.series = describe(series);
  info.modality = series.front().modality;
  if (info.modality != "CT")
    info.warnings.push_back(fmt::format("modality {} is not CT, so its values are no Hounsfield units",
                                        info.modality.empty() ? "unknown" : info.modality));
  require_equal_slices(series);
  sort_by_position(series, info);

  const SlicePlane& plane = series.front().plane;
  info.orientation = {side(plane.i_step_mm), side(plane.j_step_mm),
                      side(upward(glm::cross(plane.i_step_mm, plane.j_step_mm)))};
  auto stack = std::make_unique<DicomStack>(std::move(series));
  stack->name = path.string();
  return deliver(std::move(stack), std::move(info), options);
}

}  // namespace xraycast
