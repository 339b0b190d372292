#include "xraycast/scan/dicom_slice.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/scan/dicom_header.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

constexpr DicomTag kMediaClass = 0x00020002, kImageType = 0x00080008, kObjectClass = 0x00080016,
                   kModality = 0x00080060, kSeriesDescription = 0x0008103e, kSliceThickness = 0x00180050,
                   kSeriesUid = 0x0020000e, kSeriesNumber = 0x00200011, kImagePosition = 0x00200032,
                   kImageOrientation = 0x00200037, kSamplesPerPixel = 0x00280002,
                   kNumberOfFrames = 0x00280008, kRows = 0x00280010, kColumns = 0x00280011,
                   kPixelSpacing = 0x00280030, kBitsAllocated = 0x00280100, kBitsStored = 0x00280101,
                   kHighBit = 0x00280102, kPixelRepresentation = 0x00280103, kRescaleIntercept = 0x00281052,
                   kRescaleSlope = 0x00281053;
constexpr const char* kDeflated = "1.2.840.10008.1.2.1.99";

// ---- its slice -----------------------------------------------------------------------------------

std::vector<double> numbers(const DicomHeader& header, DicomTag tag, std::size_t count, const fs::path& file,
                            const char* name, const char* consequence) {
  std::vector<double> result = header.numbers(tag);
  if (result.size() != count || !std::ranges::all_of(result, [](double x) { return std::isfinite(x); }))
    throw DamagedSlice("{}: {} ({:04x},{:04x}) is missing or damaged, so {}; export the series again with it",
                       file.string(), name, tag >> 16, tag & 0xffff, consequence);
  return result;
}

/// The pixel coding of a transfer syntax.
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

/// Rescale slope and intercept, which give Hounsfield units. They are required in a CT slice (Type 1 of CT
/// Image Storage): with defaults of 1 and 0, most would be off by 1024 HU.
double rescale_number(const DicomHeader& header, DicomTag tag, const char* name, double of_others,
                      const fs::path& file) {
  const std::string text = header.text(tag);
  if (text.empty() && header.text(kModality) != "CT") return of_others;
  const std::vector<double> number = header.numbers(tag);
  if (number.size() != 1 || !std::isfinite(number[0]) || (tag == kRescaleSlope && number[0] == 0))
    throw DamagedSlice(
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
    throw DamagedSlice("{}: PixelSpacing (0028,0030) is {} x {} mm; it must be above zero", file.string(),
                       spacing[0], spacing[1]);
  const glm::dvec3 i(directions[0], directions[1], directions[2]),
      j(directions[3], directions[4], directions[5]);
  // Printed cosines are unit vectors up to their last digit.
  if (std::abs(glm::length(i) - 1) > 0.01 || std::abs(glm::length(j) - 1) > 0.01 ||
      std::abs(glm::dot(i, j)) > 0.01)
    throw DamagedSlice("{}: ImageOrientationPatient (0020,0037) is not two perpendicular unit vectors",
                       file.string());
  // The first spacing is the distance between rows.
  return {{position[0], position[1], position[2]},
          glm::normalize(i) * spacing[1],
          glm::normalize(j) * spacing[0]};
}

DicomSlice read_slice(const DicomHeader& header, const fs::path& file) {
  if (header.transfer_syntax() == kDeflated)
    throw InputError("{}: deflated DICOM is not supported; convert it to an uncompressed transfer syntax",
                     file.string());
  if (header.is_cut_off())
    throw DamagedSlice("{}: a damaged or truncated DICOM file; copy it again or remove it", file.string());
  if (!header.pixel_data())
    throw DamagedSlice("{}: truncated, it ends before its pixel data; copy the file again", file.string());
  if (header.unsigned_short(kSamplesPerPixel).value_or(1) != 1)
    throw InputError("{}: a colour image (SamplesPerPixel (0028,0002) is not 1); a CT slice is greyscale",
                     file.string());
  if (number_or(header, kNumberOfFrames, 1) > 1)
    throw InputError(
        "{}: several frames in one file (NumberOfFrames (0028,0008)); convert it to one file per slice or to "
        "NIfTI",
        file.string());

  DicomSlice slice;
  slice.file = file;
  slice.columns = header.unsigned_short(kColumns).value_or(0);
  slice.rows = header.unsigned_short(kRows).value_or(0);
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
    throw DamagedSlice("{}: truncated, {} of {} bytes of pixel data are there; copy the file again",
                       file.string(), pixels.length_B, needed_B);
  // The best a codec does is an empty slice of 512 x 512 pixels in some 100 bytes.
  constexpr std::int64_t kMaxPacked = 20000;
  if (pixels.encapsulated && needed_B / kMaxPacked > pixels.length_B)
    throw DamagedSlice(
        "{}: {} x {} pixels (Columns, Rows) cannot come from {} bytes of {} data; copy the file again",
        file.string(), slice.columns, slice.rows, pixels.length_B, slice.coding);
  const bool little_endian =
      header.transfer_syntax() == "1.2.840.10008.1.2" || header.transfer_syntax() == "1.2.840.10008.1.2.1";
  if (little_endian && !pixels.encapsulated && bits_allocated == 16 && slice.high_bit < 16 &&
      slice.bits_stored > 0 && slice.bits_stored <= slice.high_bit + 1)
    slice.plain_pixels_B = pixels.offset_B;
  return slice;
}

// ---- what it is ----------------------------------------------------------------------------------

/// The name of object classes that hold no greyscale images of one modality; empty for the others. DICOM
/// PS3.4, annex B.5: the numbers behind 1.2.840.10008.5.1.4.1.1.
std::string noun_of_class(std::string_view uid) {
  constexpr std::string_view kStorage = "1.2.840.10008.5.1.4.1.1.";
  struct Class {
    std::string_view number;
    const char* noun;
  };
  // The more specific ones first.
  constexpr Class kClasses[] = {
      {"7", "screen shot"},     {"11", "presentation state"},  {"66.4", "segmentation"},
      {"88.67", "dose report"}, {"88", "structured report"},   {"104", "document"},
      {"481.2", "RT dose"},     {"481.3", "RT structure set"}, {"481.5", "RT plan"}};
  if (!uid.starts_with(kStorage)) return {};
  uid.remove_prefix(kStorage.size());
  for (const auto& [number, noun] : kClasses)
    if (uid.starts_with(number) && (uid.size() == number.size() || uid[number.size()] == '.')) return noun;
  return {};
}

std::string noun_of(const DicomHeader& header, const std::string& object_class, const std::string& modality,
                    bool is_image) {
  if (std::string noun = noun_of_class(object_class); !noun.empty()) return noun;
  if (!is_image) return "other DICOM file";
  if (header.unsigned_short(kSamplesPerPixel).value_or(1) != 1) return "screen shot";
  if (modality == "PT") return "PET image";
  if (modality != "CT") return modality.empty() ? "image" : modality + " image";
  return header.text(kImageType).find("LOCALIZER") != std::string::npos ? "scout" : "CT slice";
}

}  // namespace

DicomFileSummary summarise_dicom(const fs::path& file) {
  constexpr const char* kDirectoryClass = "1.2.840.10008.1.3.10";
  constexpr std::string_view kCtClass = "1.2.840.10008.5.1.4.1.1.2";
  const DicomHeader header(file);
  DicomFileSummary summary;
  const std::string media_class = header.text(kMediaClass);
  const std::string object_class =
      header.text(kObjectClass).empty() ? media_class : header.text(kObjectClass);
  summary.is_directory = media_class == kDirectoryClass;
  summary.modality = header.text(kModality);
  summary.series_uid = header.text(kSeriesUid);
  summary.series_description = header.text(kSeriesDescription);
  summary.series_number = header.text(kSeriesNumber);

  // A truncated header may be that of a CT slice unless it says otherwise.
  const bool is_deflated = header.transfer_syntax() == kDeflated;
  summary.is_cut_off =
      header.is_cut_off() || (object_class == kCtClass && !is_deflated && !header.pixel_data());
  const bool is_unread = summary.is_cut_off || is_deflated;
  if (is_unread && summary.modality.empty() && (object_class.empty() || object_class == kCtClass))
    summary.modality = "CT";
  const bool has_size =
      header.unsigned_short(kColumns).value_or(0) > 0 && header.unsigned_short(kRows).value_or(0) > 0;
  const bool is_image = has_size || (is_unread && summary.modality == "CT");
  summary.noun = noun_of(header, object_class, summary.modality, is_image);
  summary.is_ct_slice = summary.noun == "CT slice";
  summary.is_image = is_image && header.unsigned_short(kSamplesPerPixel).value_or(1) == 1;
  if (!is_image) return summary;
  try {
    summary.slice = read_slice(header, file);
  } catch (const DamagedSlice& error) {
    summary.fault = error.what();
    summary.is_damaged = true;
  } catch (const InputError& error) {
    summary.fault = error.what();
  }
  return summary;
}

}  // namespace xraycast
