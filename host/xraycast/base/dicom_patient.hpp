#pragma once

#include <string>

namespace xraycast {

/// The patient of a DICOM file, in DICOM's notation (`Doe^Jane`) and UTF-8; empty: none.
struct DicomPatient {
  std::string name{}, id{};
  bool is_given() const { return !name.empty() || !id.empty(); }
};

/// The frame of reference of a file derived from one in `source_uid`: the same, or none (empty) if `patient`
/// was given, because patients must not share one.
inline std::string frame_of_reference_for(const DicomPatient& patient, const std::string& source_uid) {
  return patient.is_given() ? "" : source_uid;
}

/// Parses `Doe^Jane,12345`; an empty text gives no patient. Throws InputError, with `name` in front, when it
/// is not NAME,ID.
DicomPatient parse_patient(const std::string& text, const std::string& name);

/// Throws InputError when name or ID do not fit DICOM's fields: 64 characters, no backslash.
void check(const DicomPatient& patient);

}  // namespace xraycast
