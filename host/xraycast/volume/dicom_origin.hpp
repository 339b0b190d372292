#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace xraycast {

/// A DICOM file's patient, study and frame of reference, which files derived from it repeat. Spelt as in the
/// file, in its own character set; empty where the file has no value.
struct DicomStudy {
  std::string character_set;
  std::string uid, date, time, id, accession_number, referring_physician;
  std::string patient_name, patient_id, birth_date, sex;
  std::string frame_of_reference_uid, position_reference;
};

/// Where a field of DicomStudy stands: (0020,000d) is 0x0020000d.
struct DicomStudyField {
  std::uint32_t tag;
  std::string DicomStudy::*text;
};

inline constexpr std::array kDicomStudyFields{
    DicomStudyField{0x00080005, &DicomStudy::character_set},
    DicomStudyField{0x00080020, &DicomStudy::date},
    DicomStudyField{0x00080030, &DicomStudy::time},
    DicomStudyField{0x00080050, &DicomStudy::accession_number},
    DicomStudyField{0x00080090, &DicomStudy::referring_physician},
    DicomStudyField{0x00100010, &DicomStudy::patient_name},
    DicomStudyField{0x00100020, &DicomStudy::patient_id},
    DicomStudyField{0x00100030, &DicomStudy::birth_date},
    DicomStudyField{0x00100040, &DicomStudy::sex},
    DicomStudyField{0x0020000d, &DicomStudy::uid},
    DicomStudyField{0x00200010, &DicomStudy::id},
    DicomStudyField{0x00200052, &DicomStudy::frame_of_reference_uid},
    DicomStudyField{0x00201040, &DicomStudy::position_reference}};

/// The series that a scan was read from, slice by slice, to which derived files refer. UIDs that are invalid,
/// or that differ between slices where they must be the same, are empty.
struct DicomOrigin {
  DicomStudy study;  ///< of the most inferior slice
  std::string series_uid;
  std::array<double, 6> directions{};        ///< of rows and columns, LPS
  std::array<double, 2> pixel_spacing_mm{};  ///< between rows, then between columns

  struct Slice {
    std::string sop_class_uid, sop_instance_uid;
    std::int64_t frame;                 ///< from 1 on, of several in its file; otherwise 0
    std::array<double, 3> position_mm;  ///< of its first pixel, LPS
  };
  std::vector<Slice> slices;  ///< those that were taken, ascending along their normal
};

}  // namespace xraycast
