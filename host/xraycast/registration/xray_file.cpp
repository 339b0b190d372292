#include "xraycast/registration/xray_file.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/projection/view.hpp"
#include "xraycast/series/dicom_header.hpp"

#include <glm/trigonometric.hpp>

#include <bit>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

constexpr DicomTag kSourceToDetector = 0x00181110, kSourceToPatient = 0x00181111,
                   kImagerPixelSpacing = 0x00181164, kPrimaryAngle = 0x00181510, kSecondaryAngle = 0x00181511,
                   kPrimaryIncrements = 0x00181520, kSecondaryIncrements = 0x00181521, kFrames = 0x00280008,
                   kRows = 0x00280010, kColumns = 0x00280011, kBitsAllocated = 0x00280100,
                   kSamplesPerPixel = 0x00280002, kPixelRepresentation = 0x00280103;

std::optional<double> number(const DicomHeader& header, DicomTag tag, std::size_t index = 0) {
  const std::vector<double> numbers = header.numbers(tag);
  if (index >= numbers.size()) return std::nullopt;
  return numbers[index];
}

/// The camera of a frame; none where something is missing.
std::optional<PinholeCamera> camera_of(const DicomHeader& header, std::size_t frame, int width, int height) {
  const auto detector = number(header, kSourceToDetector), patient = number(header, kSourceToPatient),
             pixel = number(header, kImagerPixelSpacing), primary = number(header, kPrimaryAngle),
             secondary = number(header, kSecondaryAngle);
  if (!detector || !patient || !pixel || !primary || !secondary) return std::nullopt;
  if (!(*patient > 0 && *detector > *patient && *pixel > 0)) return std::nullopt;
  View view;
  view.lao_rad = glm::radians(*primary + number(header, kPrimaryIncrements, frame).value_or(0));
  view.cranial_rad = glm::radians(*secondary + number(header, kSecondaryIncrements, frame).value_or(0));
  view.cone = Cone{*patient, *detector};
  view.width = width;
  view.height = height;
  view.pixel_mm = *pixel;
  return camera_of(view);
}

/// Where the pixels are in the file, and what they are.
struct Layout {
  int width, height;
  std::size_t frames, bytes;  ///< per pixel
  bool is_signed, is_swapped;
  std::int64_t offset_B;
  std::size_t frame_B() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * bytes;
  }
};

Layout layout_of(const DicomHeader& header, const std::string& name) {
  const auto rows = header.unsigned_short(kRows), columns = header.unsigned_short(kColumns),
             bits = header.unsigned_short(kBitsAllocated);
  const auto& pixels = header.pixel_data();
  if (!rows || !columns || !bits || !pixels) throw InputError("{}: has no picture", name);
  if (header.unsigned_short(kSamplesPerPixel).value_or(1) != 1)
    throw InputError("{}: its picture is in colour, and not an X-ray", name);
  if (pixels->encapsulated || header.deflated_B())
    throw InputError("{}: its picture is compressed; decompress it, as by `dcmdjpeg` or `gdcmconv --raw`",
                     name);
  if (*bits != 8 && *bits != 16) throw InputError("{}: pixels of {} bits are not supported", name, *bits);
  const double frames = number(header, kFrames).value_or(1);
  if (!(frames >= 1 && frames <= 1e5)) throw InputError("{}: Number of Frames must be 1 to 100000", name);
  Layout layout{.width = *columns,
                .height = *rows,
                .frames = static_cast<std::size_t>(frames),
                .bytes = *bits / std::size_t{8},
                .is_signed = header.unsigned_short(kPixelRepresentation).value_or(0) == 1,
                .is_swapped = pixels->byte_swapped,
                .offset_B = pixels->offset_B};
  if (static_cast<std::int64_t>(layout.frames * layout.frame_B()) > pixels->length_B)
    throw InputError("{}: the file ends within its pictures", name);
  return layout;
}

float value_of(const unsigned char* bytes, const Layout& layout) {
  if (layout.bytes == 1) return *bytes;
  const unsigned low = bytes[layout.is_swapped ? 1 : 0], high = bytes[layout.is_swapped ? 0 : 1];
  const auto value = static_cast<std::uint16_t>(high << 8 | low);
  return layout.is_signed ? static_cast<float>(std::bit_cast<std::int16_t>(value))
                          : static_cast<float>(value);
}

std::vector<Xray> read_dicom(const fs::path& path) {
  const DicomHeader header(path);
  const Layout layout = layout_of(header, path.string());
  std::ifstream file(path, std::ios::binary);
  file.seekg(layout.offset_B);
  std::vector<Xray> xrays;
  std::vector<unsigned char> bytes(layout.frame_B());
  for (std::size_t frame = 0; frame < layout.frames; ++frame) {
    file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    if (!file) throw InputError("{}: the file ends within its pictures", path.string());
    Xray xray{.name = path.string(), .width = layout.width, .height = layout.height, .pixels = {}};
    if (layout.frames > 1) xray.name += ", frame " + std::to_string(frame + 1);
    for (std::size_t i = 0; i < bytes.size(); i += layout.bytes)
      xray.pixels.push_back(value_of(&bytes[i], layout));
    xray.camera = camera_of(header, frame, layout.width, layout.height);
    xrays.push_back(std::move(xray));
  }
  return xrays;
}

std::string leading_bytes(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string bytes(256, '\0');
  file.read(bytes.data(), std::ssize(bytes));
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  return bytes;
}

}  // namespace

std::vector<Xray> read_xrays(const fs::path& path) {
  if (!fs::is_regular_file(path)) throw InputError("{}: no such file", path.string());
  if (is_dicom(leading_bytes(path))) return read_dicom(path);
  FloatPicture picture = read_grey_picture(path);
  return {{.name = path.string(),
           .width = picture.width,
           .height = picture.height,
           .pixels = std::move(picture.grey)}};
}

}  // namespace xraycast
