#include "xraycast/registration/xray_file.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/projection/view.hpp"
#include "xraycast/series/dicom_frames.hpp"
#include "xraycast/series/dicom_header.hpp"
#include "xraycast/series/dicom_pixels.hpp"

#include <glm/trigonometric.hpp>

#include <cmath>
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
                   kPrimaryIncrements = 0x00181520, kSecondaryIncrements = 0x00181521;

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

/// So that all stored values stay within a volume's 16 bits; brightness and contrast do not matter.
void fit_into_hu(DicomSlice& slice) {
  const int bits = slice.pixels.bits_stored;
  slice.slope = bits > 15 ? 0.5 : 1;
  slice.intercept = slice.pixels.is_signed ? slice.slope * std::exp2(bits - 1) : 0;
}

std::vector<Xray> read_dicom(const fs::path& path) {
  const DicomHeader header(path);
  std::vector<DicomSlice> slices = read_pictures(header, path);
  for (DicomSlice& slice : slices) {
    if (slice.pixels.bits_allocated > 16)
      throw InputError("{}: pixels of {} bits are not supported; export it with 16", path.string(),
                       slice.pixels.bits_allocated);
    fit_into_hu(slice);
  }
  DicomPixelDecoder decoder;
  decoder.prepare(slices);
  std::vector<Xray> xrays;
  for (const DicomSlice& slice : slices) {
    Xray xray{.name = slice.name(),
              .width = static_cast<int>(slice.columns),
              .height = static_cast<int>(slice.rows),
              .pixels = {}};
    std::vector<std::int16_t> values(static_cast<std::size_t>(slice.columns * slice.rows));
    decoder.decode(slice, values);
    xray.pixels.assign(values.begin(), values.end());
    xray.camera = camera_of(header, xrays.size(), xray.width, xray.height);
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
