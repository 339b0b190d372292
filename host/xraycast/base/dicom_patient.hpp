#pragma once

#include <string>

namespace xraycast {

/// Whose DICOM file it is, as DICOM spells it (`Doe^Jane`), in UTF-8; empty: nobody's.
struct DicomPatient {
  std::string name{}, id{};
};

/// `Doe^Jane,12345`, or nobody for an empty text. Throws InputError, with `name` in front, when it is not
/// NAME,ID.
DicomPatient parse_patient(const std::string& text, const std::string& name);

/// Throws InputError when name or ID do not fit DICOM's fields: 64 characters, no backslash.
void check(const DicomPatient& patient);

}  // namespace xraycast
