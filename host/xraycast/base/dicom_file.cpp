#include "xraycast/base/dicom_file.hpp"

#include "xraycast/base/error.hpp"

#include <gdcmDicts.h>
#include <gdcmGlobal.h>
#include <gdcmSequenceOfItems.h>
#include <gdcmTrace.h>
#include <gdcmWriter.h>

#include <bit>
#include <ctime>
#include <random>
#include <sstream>

namespace xraycast {
namespace {

static_assert(std::endian::native == std::endian::little, "words are written as they lie in memory");

gdcm::Tag gdcm_tag(DicomTag tag) {
  return {static_cast<std::uint16_t>(tag >> 16), static_cast<std::uint16_t>(tag & 0xffff)};
}

/// The dictionary leaves open whether pixels and lookup tables are bytes or words: here they are words.
gdcm::VR vr_of(DicomTag tag) {
  const gdcm::VR vr = gdcm::Global::GetInstance().GetDicts().GetDictEntry(gdcm_tag(tag)).GetVR();
  if (vr == gdcm::VR::OB_OW || vr == gdcm::VR::US_OW || vr == gdcm::VR::US_SS_OW) return gdcm::VR::OW;
  if (vr == gdcm::VR::US_SS) return gdcm::VR::US;
  return vr;
}

gdcm::DataSet to_gdcm(const DicomElements& elements);

gdcm::DataElement to_gdcm(DicomTag tag, const std::string& value) {
  gdcm::DataElement element(gdcm_tag(tag));
  element.SetVR(vr_of(tag));
  std::string padded = value;
  if (padded.size() % 2 == 1) padded += element.GetVR() == gdcm::VR::UI ? '\0' : ' ';
  element.SetByteValue(padded.data(), gdcm::VL(static_cast<std::uint32_t>(padded.size())));
  return element;
}

gdcm::DataElement to_gdcm(DicomTag tag, const std::vector<DicomElements>& items) {
  const gdcm::SmartPointer<gdcm::SequenceOfItems> sequence = new gdcm::SequenceOfItems;
  sequence->SetLengthToUndefined();
  for (const DicomElements& elements : items) {
    gdcm::Item item;
    item.SetVLToUndefined();
    item.SetNestedDataSet(to_gdcm(elements));
    sequence->AddItem(item);
  }
  gdcm::DataElement element(gdcm_tag(tag));
  element.SetVR(gdcm::VR::SQ);
  element.SetValue(*sequence);
  element.SetVLToUndefined();
  return element;
}

gdcm::DataSet to_gdcm(const DicomElements& elements) {
  gdcm::DataSet set;
  for (const auto& [tag, value] : elements.values()) set.Replace(to_gdcm(tag, value));
  for (const auto& [tag, items] : elements.sequences()) set.Replace(to_gdcm(tag, items));
  return set;
}

/// Everything but the pixels.
std::string elements_bytes(const DicomElements& elements) {
  gdcm::Trace::WarningOff();
  gdcm::Writer writer;
  std::ostringstream bytes;
  writer.SetStream(bytes);
  writer.GetFile().GetHeader().SetDataSetTransferSyntax(gdcm::TransferSyntax::ExplicitVRLittleEndian);
  writer.GetFile().SetDataSet(to_gdcm(elements));
  if (!writer.Write()) throw Error("GDCM could not write a DICOM header");
  return bytes.str();
}

/// The shortest text that reads back as the same number, or as many digits as 16 bytes hold.
std::string decimal_string(double value) {
  constexpr std::size_t kMost_B = 16;
  std::string text = fmt::format("{}", value);
  for (int digits = 15; text.size() > kMost_B; --digits) text = fmt::format("{:.{}g}", value, digits);
  return text;
}

std::string local_time(const char* format) {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char text[16];
  return {text, std::strftime(text, sizeof text, format, &local)};
}

}  // namespace

void DicomElements::text(DicomTag tag, std::string_view value) { values_[tag] = value; }

void DicomElements::numbers(DicomTag tag, std::span<const double> values) {
  std::string text;
  for (const double value : values) {
    if (!text.empty()) text += '\\';
    text += decimal_string(value);
  }
  values_[tag] = text;
}

void DicomElements::words(DicomTag tag, std::span<const std::uint16_t> values) {
  values_[tag] = {reinterpret_cast<const char*>(values.data()), values.size_bytes()};
}

void DicomElements::sequence(DicomTag tag, std::vector<DicomElements> items) {
  sequences_[tag] = std::move(items);
}

std::string new_dicom_uid() {
  __extension__ using Uuid = unsigned __int128;
  std::random_device random;
  Uuid uuid = 0;
  for (int i = 0; i < 4; ++i) uuid = uuid << 32 | random();
  // Version 4 (random), variant 1 (RFC 4122).
  uuid = (uuid & ~(Uuid{0xf} << 76)) | Uuid{4} << 76;
  uuid = (uuid & ~(Uuid{3} << 62)) | Uuid{2} << 62;
  return fmt::format("2.25.{}", uuid);
}

DicomElements dicom_elements(std::string_view sop_class_uid, const DicomPatient& patient) {
  DicomElements elements;
  elements.text(0x00080005, "ISO_IR 192");  // Specific Character Set: UTF-8
  elements.text(0x00080016, sop_class_uid);
  elements.text(0x00080018, new_dicom_uid());  // SOP Instance UID
  const std::string date = local_time("%Y%m%d"), time = local_time("%H%M%S");
  elements.text(0x00080023, date);             // Content Date
  elements.text(0x00080033, time);             // Content Time
  elements.text(0x00080020, date);             // Study Date
  elements.text(0x00080030, time);             // Study Time
  elements.text(0x00080050, "");               // Accession Number
  elements.text(0x00080070, "xraycast");       // Manufacturer
  elements.text(0x00081090, "xraycast");       // Manufacturer's Model Name
  elements.text(0x00080090, "");               // Referring Physician's Name
  elements.text(0x00100010, patient.name);     // Patient's Name
  elements.text(0x00100020, patient.id);       // Patient ID
  elements.text(0x00100030, "");               // Patient's Birth Date
  elements.text(0x00100040, "");               // Patient's Sex
  elements.text(0x0020000d, new_dicom_uid());  // Study Instance UID
  elements.text(0x0020000e, new_dicom_uid());  // Series Instance UID
  elements.text(0x00200010, "");               // Study ID
  elements.text(0x00200011, "1");              // Series Number
  elements.text(0x00200013, "1");              // Instance Number
  return elements;
}

std::string dicom_header(const DicomElements& elements, std::int64_t pixels_B) {
  const auto length = static_cast<std::uint32_t>(pixels_B);
  // Pixel Data comes last, so the pixels need no copy within GDCM.
  std::string bytes = elements_bytes(elements) + std::string("\xe0\x7f\x10\x00OW\0\0", 8);
  return bytes.append(reinterpret_cast<const char*>(&length), sizeof length);
}

void write_dicom(const DicomElements& elements, std::span<const std::byte> pixels, AtomicFile& file) {
  const std::string header = dicom_header(elements, std::ssize(pixels));
  const std::int64_t needed_B = std::ssize(header) + std::ssize(pixels);
  file.write(header, needed_B);
  file.write({reinterpret_cast<const char*>(pixels.data()), pixels.size()}, needed_B);
  file.commit();
}

}  // namespace xraycast
