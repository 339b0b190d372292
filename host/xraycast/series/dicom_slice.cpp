#include "xraycast/series/dicom_slice.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/series/dicom_frames.hpp"
#include "xraycast/series/dicom_tags.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

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

/// Of a slice, or of frames, native or converted from slices.
bool is_ct_class(const std::string& uid) {
  constexpr std::array kClasses{"1.2.840.10008.5.1.4.1.1.2", "1.2.840.10008.5.1.4.1.1.2.1",
                                "1.2.840.10008.5.1.4.1.1.2.2"};
  return std::ranges::find(kClasses, uid) != kClasses.end();
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

// ---- whose it is -----------------------------------------------------------------------------------

/// As 2026-01-31, of DICOM's 20260131 or ACR-NEMA's 2026.01.31; empty for what is no date.
std::string iso_date(std::string text) {
  std::erase(text, '.');
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  if (text.size() != 8 || !std::ranges::all_of(text, is_digit)) return {};
  return text.substr(0, 4) + "-" + text.substr(4, 2) + "-" + text.substr(6);
}

}  // namespace

std::int64_t DicomPixels::size_B() const {
  std::int64_t sum_B = 0;
  for (const ByteRange& piece : pieces) sum_B += piece.length_B;
  return sum_B;
}

bool DicomPixels::is_plain() const {
  return !is_encapsulated && bits_allocated == 16 && high_bit < 16 && bits_stored > 0 &&
         bits_stored <= high_bit + 1;
}

std::string DicomSlice::name() const {
  return frame == 0 ? file.string() : fmt::format("{}: frame {}", file.string(), frame);
}

DicomFileSummary summarise_dicom(const fs::path& file) {
  constexpr const char* kDirectoryClass = "1.2.840.10008.1.3.10";
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
  summary.body_part = header.text(kBodyPartExamined);
  summary.study_uid = header.text(kStudyUid);
  summary.study_date = iso_date(header.text(kStudyDate));
  summary.patient_id = header.text(kPatientId);
  summary.patient_name = header.text(kPatientName);

  // A truncated header may be that of a CT slice unless it says otherwise.
  summary.is_cut_off = header.is_cut_off() || (is_ct_class(object_class) && !header.pixel_data());
  if (summary.is_cut_off && summary.modality.empty() && (object_class.empty() || is_ct_class(object_class)))
    summary.modality = "CT";
  const bool has_size =
      header.unsigned_short(kColumns).value_or(0) > 0 && header.unsigned_short(kRows).value_or(0) > 0;
  const bool may_be_image = has_size || (summary.is_cut_off && summary.modality == "CT");
  summary.noun = noun_of(header, object_class, summary.modality, may_be_image);
  const bool is_image = may_be_image && summary.noun != "segmentation";
  summary.is_ct_slice = summary.noun == "CT slice";
  summary.is_image = is_image && header.unsigned_short(kSamplesPerPixel).value_or(1) == 1;
  if (!is_image) return summary;
  try {
    read_slices(header, file, summary);
  } catch (const DamagedSlice& error) {
    summary.fault = error.what();
    summary.is_damaged = true;
  } catch (const InputError& error) {
    summary.fault = error.what();
  }
  if (summary.slices.empty()) summary.faulty_slices = std::max<std::int64_t>(1, summary.faulty_slices);
  return summary;
}

}  // namespace xraycast
