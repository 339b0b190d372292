#include "xraycast/base/dicom_patient.hpp"

#include "xraycast/base/error.hpp"

#include <algorithm>
#include <cstddef>

namespace xraycast {
namespace {

/// Characters of UTF-8.
std::ptrdiff_t characters(const std::string& text) {
  return std::ranges::count_if(text, [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; });
}

void check_patient_field(const std::string& value, const char* field) {
  constexpr std::ptrdiff_t kMost = 64;
  if (characters(value) > kMost)
    throw InputError("the patient's {} '{}' has {} characters; DICOM allows {}", field, value,
                     characters(value), kMost);
  if (std::ranges::any_of(value, [](char c) { return static_cast<unsigned char>(c) < ' ' || c == '\\'; }))
    throw InputError("the patient's {} '{}' holds a backslash or a control character; leave it out", field,
                     value);
}

}  // namespace

DicomPatient parse_patient(const std::string& text, const std::string& name) {
  if (text.empty()) return {};
  const auto comma = text.rfind(',');
  if (comma == std::string::npos || comma == 0 || comma + 1 == text.size())
    throw InputError("{} {}: must be NAME,ID, such as Doe^Jane,12345", name, text);
  return {text.substr(0, comma), text.substr(comma + 1)};
}

void check(const DicomPatient& patient) {
  check_patient_field(patient.name, "name");
  check_patient_field(patient.id, "ID");
}

}  // namespace xraycast
