#pragma once

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/dicom_patient.hpp"

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace xraycast {

/// Group and element number in one: (0020,0032) is 0x00200032.
using DicomTag = std::uint32_t;

/// A DICOM data set to write. GDCM's dictionary knows the value representation of each tag; a value that is
/// set again replaces the earlier one.
class DicomElements {
 public:
  /// Any text, `\` between several values, in UTF-8, which (0008,0005) declares.
  void text(DicomTag tag, std::string_view value);

  /// Decimal or integer strings, each as precise as the 16 bytes that the standard allows.
  void numbers(DicomTag tag, std::span<const double> values);
  void number(DicomTag tag, double value) { numbers(tag, {&value, 1}); }

  /// Binary 16-bit words: US, OW, or the two halves of a tag (AT).
  void words(DicomTag tag, std::span<const std::uint16_t> values);
  void word(DicomTag tag, std::uint16_t value) { words(tag, {&value, 1}); }

  void sequence(DicomTag tag, std::vector<DicomElements> items);

  /// The encoded elements: the writer pads texts to an even length.
  const std::map<DicomTag, std::string>& values() const { return values_; }
  const std::map<DicomTag, std::vector<DicomElements>>& sequences() const { return sequences_; }

 private:
  std::map<DicomTag, std::string> values_;
  std::map<DicomTag, std::vector<DicomElements>> sequences_;
};

/// A new UID, made of a random UUID: `2.25.` and its decimal number (PS3.5, B.2).
std::string new_dicom_uid();

/// The elements common to every file: equipment, date and time, SOP class and a new SOP instance, the
/// patient, and a new study and series, with their type 2 elements empty.
DicomElements dicom_elements(std::string_view sop_class_uid, const DicomPatient& patient);

/// The maximum number of pixel bytes in one file: the length has 32 bits.
inline constexpr std::int64_t kMostDicomPixels_B = 0xfffffffe;

/// A file in explicit VR, little endian, uncompressed: everything before the pixels, which are OW and an even
/// number of bytes.
std::string dicom_header(const DicomElements& elements, std::int64_t pixels_B);

/// Writes a file with these pixels and commits it. Throws Error when the disk is full.
void write_dicom(const DicomElements& elements, std::span<const std::byte> pixels, AtomicFile& file);

}  // namespace xraycast
