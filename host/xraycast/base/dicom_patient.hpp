#pragma once

#include <string>

namespace xraycast {

/// The patient of a DICOM file, in DICOM's notation (`Doe^Jane`) and UTF-8; empty: none.
struct DicomPatient {
  std::string name{}, id{};
};

/// Parses `Doe^Jane,12345`; an empty text gives no patient. Throws InputError, with `name` in front, when it
/// is not NAME,ID.
DicomPatient parse_patient(const std::string& text, const std::string& name);

/// Throws InputError when name or ID do not fit DICOM's fields: 64 characters, no backslash.
void check(const DicomPatient& patient);

}  // namespace xraycast
