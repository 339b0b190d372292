#include "xraycast/series/seg_file.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/dicom_file.hpp"

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

// DICOM PS3.3, A.51 and C.8.20; codes of PS3.16.
namespace xraycast {
namespace {

constexpr std::int64_t kBitsOfByte = 8;

DicomElements code(std::string_view value, std::string_view scheme, std::string_view meaning) {
  DicomElements item;
  item.text(0x00080100, value);
  item.text(0x00080102, scheme);
  item.text(0x00080104, meaning);
  return item;
}

/// A sequence's one item, with one value.
DicomElements item_of(DicomTag tag, std::span<const double> values) {
  DicomElements item;
  item.numbers(tag, values);
  return item;
}

// ---- what it refers to -----------------------------------------------------------------------------

void repeat_study(DicomElements& seg, const DicomStudy& study) {
  for (const auto& [tag, text] : kDicomStudyFields)
    if (tag != 0x00080005 || !(study.*text).empty()) seg.text(tag, study.*text);
}

DicomElements reference_to(const DicomOrigin::Slice& slice) {
  DicomElements reference;
  reference.text(0x00081150, slice.sop_class_uid);     // Referenced SOP Class UID
  reference.text(0x00081155, slice.sop_instance_uid);  // Referenced SOP Instance UID
  return reference;
}

DicomElements referenced_series(const DicomOrigin& origin) {
  std::vector<DicomElements> files;
  std::set<std::string> seen;
  for (const DicomOrigin::Slice& slice : origin.slices)
    if (seen.insert(slice.sop_instance_uid).second) files.push_back(reference_to(slice));
  DicomElements series;
  series.text(0x0020000e, origin.series_uid);
  series.sequence(0x0008114a, std::move(files));  // Referenced Instance Sequence
  return series;
}

DicomElements derivation_from(const DicomOrigin::Slice& slice) {
  DicomElements source = reference_to(slice);
  if (slice.frame > 0) source.number(0x00081160, static_cast<double>(slice.frame));
  source.text(0x0028135a, "YES");  // Spatial Locations Preserved
  source.sequence(0x0040a170, {code("121322", "DCM", "Source image for image processing operation")});
  DicomElements derivation;
  derivation.sequence(0x00082112, {source});                                 // Source Image Sequence
  derivation.sequence(0x00089215, {code("113076", "DCM", "Segmentation")});  // Derivation Code Sequence
  return derivation;
}

// ---- its one segment ---------------------------------------------------------------------------------

DicomElements vessels(const SegOptions& options) {
  DicomElements segment;
  segment.word(0x00620004, 1);  // Segment Number
  segment.text(0x00620005, "Vessels");
  segment.text(0x00620006, "Lumen of vessels, filled with contrast agent");
  segment.text(0x00620008, options.is_automatic ? "AUTOMATIC" : "SEMIAUTOMATIC");
  segment.text(0x00620009, "xraycast segment");  // Segment Algorithm Name
  // Recommended Display CIELab Value: a light red, L* 56, a* 43, b* 36.
  segment.words(0x0062000d, std::vector<std::uint16_t>{36700, 43947, 42148});
  // Segmented Property Category and Type, of CID 7150 and 7151.
  segment.sequence(0x00620003, {code("91723000", "SCT", "Anatomical Structure")});
  segment.sequence(0x0062000f, {code("91747007", "SCT", "Lumen of blood vessel")});
  return segment;
}

// ---- its frames ------------------------------------------------------------------------------------

void add_image(DicomElements& seg, const ScanInfo& scan) {
  seg.text(0x00080008, "DERIVED\\PRIMARY");  // Image Type
  seg.word(0x00280002, 1);                   // Samples per Pixel
  seg.text(0x00280004, "MONOCHROME2");       // Photometric Interpretation
  seg.number(0x00280008, static_cast<double>(scan.size.z));
  seg.word(0x00280010, static_cast<std::uint16_t>(scan.size.y));
  seg.word(0x00280011, static_cast<std::uint16_t>(scan.size.x));
  seg.word(0x00280100, 1);     // Bits Allocated
  seg.word(0x00280101, 1);     // Bits Stored
  seg.word(0x00280102, 0);     // High Bit
  seg.word(0x00280103, 0);     // Pixel Representation: unsigned
  seg.text(0x00282110, "00");  // Lossy Image Compression
  seg.text(0x00620001, "BINARY");
}

/// Frames are ordered by segment, of which there is one, and by place.
void add_dimensions(DicomElements& seg) {
  const std::string uid = new_dicom_uid();
  const auto dimension = [&](DicomTag index, DicomTag group, const char* label) {
    const auto words = [](DicomTag tag) {
      return std::vector{static_cast<std::uint16_t>(tag >> 16), static_cast<std::uint16_t>(tag & 0xffff)};
    };
    DicomElements item;
    item.text(0x00209164, uid);
    item.words(0x00209165, words(index));  // Dimension Index Pointer
    item.words(0x00209167, words(group));  // Functional Group Pointer
    item.text(0x00209421, label);
    return item;
  };
  DicomElements organization;
  organization.text(0x00209164, uid);
  seg.sequence(0x00209221, {organization});  // Dimension Organization Sequence
  seg.text(0x00209311, "3D");                // Dimension Organization Type
  seg.sequence(0x00209222, {dimension(0x0062000b, 0x0062000a, "Segment"),
                            dimension(0x00200032, 0x00209113, "Image Position (Patient)")});
}

DicomElements shared_groups(const DicomOrigin& origin, double slice_spacing_mm) {
  DicomElements measures = item_of(0x00280030, origin.pixel_spacing_mm);
  measures.number(0x00180050, slice_spacing_mm);  // Slice Thickness
  measures.number(0x00180088, slice_spacing_mm);  // Spacing Between Slices
  DicomElements groups;
  groups.sequence(0x00289110, {measures});
  groups.sequence(0x00209116, {item_of(0x00200037, origin.directions)});  // Plane Orientation Sequence
  return groups;
}

DicomElements groups_of_frame(const DicomOrigin::Slice& slice, std::uint32_t frame) {
  DicomElements content, segment, groups;
  content.long_words(0x00209157, std::vector<std::uint32_t>{1, frame});  // Dimension Index Values
  segment.word(0x0062000b, 1);                                           // Referenced Segment Number
  groups.sequence(0x00089124, {derivation_from(slice)});
  groups.sequence(0x00209111, {content});
  groups.sequence(0x00209113, {item_of(0x00200032, slice.position_mm)});  // Plane Position Sequence
  groups.sequence(0x0062000a, {segment});
  return groups;
}

/// One bit a voxel, the first one lowest; frames follow without a gap, and the last byte makes the length
/// even.
std::vector<std::byte> packed(std::span<const std::uint8_t> mask) {
  const std::size_t pairs = (mask.size() + 2 * kBitsOfByte - 1) / (2 * kBitsOfByte);
  std::vector<std::byte> bytes(2 * pairs);
  for (std::size_t i = 0; i < mask.size(); ++i)
    if (mask[i] != 0) bytes[i / kBitsOfByte] |= std::byte{1} << (i % kBitsOfByte);
  return bytes;
}

bool have_uids(const DicomOrigin& origin) {
  std::set<std::pair<std::string, std::int64_t>> seen;
  return std::ranges::all_of(origin.slices, [&](const DicomOrigin::Slice& slice) {
    return !slice.sop_class_uid.empty() && !slice.sop_instance_uid.empty() &&
           seen.emplace(slice.sop_instance_uid, slice.frame).second;
  });
}

}  // namespace

std::string why_no_seg(const ScanInfo& scan) {
  if (!scan.dicom) return fmt::format("the scan is {}, not a DICOM series", scan.format);
  if (!scan.keeps_grid) return "the slices were resampled or reoriented, so the mask is on another grid";
  const auto lacking = [](const char* field) {
    return fmt::format("{} is missing, damaged or not the same in all slices", field);
  };
  if (scan.dicom->study.uid.empty()) return lacking("StudyInstanceUID (0020,000d)");
  if (scan.dicom->series_uid.empty()) return lacking("SeriesInstanceUID (0020,000e)");
  if (!have_uids(*scan.dicom)) return "not every slice has a SOPInstanceUID (0008,0018) of its own";
  if (scan.size.x * scan.size.y > kBitsOfByte * kMostDicomPixels_B / scan.size.z)
    return "the mask has more voxels than one DICOM file can hold";
  return "";
}

void write_seg(const ScanInfo& scan, double slice_spacing_mm, std::span<const std::uint8_t> mask,
               const SegOptions& options, const std::filesystem::path& path) {
  const DicomOrigin& origin = scan.dicom.value();
  AtomicFile file(path);
  DicomElements seg = dicom_elements("1.2.840.10008.5.1.4.1.1.66.4", {});
  repeat_study(seg, origin.study);
  if (origin.study.frame_of_reference_uid.empty()) seg.text(0x00200052, new_dicom_uid());
  seg.text(0x00080060, "SEG");
  seg.text(0x0008103e, "Vessels, segmented by xraycast");  // Series Description
  seg.text(0x00200011, "1000");                            // Series Number: behind those of scanners
  seg.text(0x00181000, "none");                            // Device Serial Number
  seg.text(0x00181020, options.software_version);
  seg.text(0x00700080, "VESSELS");                                    // Content Label
  seg.text(0x00700081, "Vessels by xraycast; not for clinical use");  // Content Description
  seg.text(0x00700084, "");                                           // Content Creator's Name
  seg.sequence(0x00081115, {referenced_series(origin)});
  seg.sequence(0x00620002, {vessels(options)});
  add_image(seg, scan);
  add_dimensions(seg);
  seg.sequence(0x52009229, {shared_groups(origin, slice_spacing_mm)});
  std::vector<DicomElements> frames;
  for (const DicomOrigin::Slice& slice : origin.slices)
    frames.push_back(groups_of_frame(slice, static_cast<std::uint32_t>(frames.size() + 1)));
  seg.sequence(0x52009230, std::move(frames));
  write_dicom(seg, packed(mask), file);
}

}  // namespace xraycast
