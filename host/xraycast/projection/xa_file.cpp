#include "xraycast/projection/xa_file.hpp"

#include "xraycast/base/dicom_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <utility>

// DICOM PS3.3, A.14 and C.8.7.
namespace xraycast {
namespace {

constexpr double kXaDegrees = 180 / std::numbers::pi;
constexpr int kFullIntensity = 4095;
constexpr double kGreysPerTau = 256;  // tau 16 is black: a ten-millionth of the beam
constexpr std::int64_t kMostMaskedFrames = 65535;

/// Without the rounding of the conversion to radians and back.
double xa_degrees(double radians) { return std::round(radians * kXaDegrees * 1e9) / 1e9; }

/// Positioner angles: LAO and cranial are positive, -180 to 180 and -90 to 90 deg.
double positioner_deg(double radians) { return std::remainder(xa_degrees(radians), 360.0); }

std::uint16_t pixel_of(float tau, XaIntensity intensity) {
  const double value = intensity == XaIntensity::linear ? kFullIntensity * std::exp(-double{tau})
                                                        : kFullIntensity - kGreysPerTau * double{tau};
  // NaN becomes black.
  return static_cast<std::uint16_t>(std::lround(std::fmin(std::fmax(value, 0), kFullIntensity)));
}

/// From logarithmic pixels back to the intensity, as 16 bits: required by the standard for LOG images.
DicomElements intensity_table() {
  std::vector<std::uint16_t> intensities;
  for (int pixel = 0; pixel <= kFullIntensity; ++pixel) {
    const double tau = (kFullIntensity - pixel) / kGreysPerTau;
    intensities.push_back(static_cast<std::uint16_t>(std::lround(65535 * std::exp(-tau))));
  }
  DicomElements table;
  table.words(0x00283002, std::vector<std::uint16_t>{kFullIntensity + 1, 0, 16});  // LUT Descriptor
  table.text(0x00283003, "X-ray intensity");                                       // LUT Explanation
  table.text(0x00283004, "US");                                                    // Modality LUT Type
  table.words(0x00283006, intensities);                                            // LUT Data
  return table;
}

void add_image(DicomElements& image, const View& view, std::span<const std::uint16_t> pixels,
               const XaOptions& options) {
  // 8, 10, 12 or 16 (C.8.7.1.1.6): codes of 14 bits count as 16.
  constexpr int kOwnBits = 12;
  const int used = options.code_bits.value_or(kOwnBits);
  const std::uint16_t bits = used <= 8 ? 8 : used <= 10 ? 10 : used <= 12 ? 12 : 16;
  image.word(0x00280002, 1);              // Samples per Pixel
  image.text(0x00280004, "MONOCHROME2");  // Photometric Interpretation
  image.word(0x00280010, static_cast<std::uint16_t>(view.height));
  image.word(0x00280011, static_cast<std::uint16_t>(view.width));
  image.word(0x00280100, 16);                                    // Bits Allocated
  image.word(0x00280101, bits);                                  // Bits Stored
  image.word(0x00280102, static_cast<std::uint16_t>(bits - 1));  // High Bit
  image.word(0x00280103, 0);                                     // Pixel Representation: unsigned
  image.text(0x00280301, "NO");                                  // Burned In Annotation
  image.text(0x00282110, "00");                                  // Lossy Image Compression
  const bool is_log = !options.code_bits && options.intensity == XaIntensity::logarithmic;
  image.text(0x00281040, is_log ? "LOG" : "LIN");  // Pixel Intensity Relationship
  if (is_log) image.sequence(0x00283000, {intensity_table()});
  const auto [darkest, lightest] = std::ranges::minmax(pixels);
  image.number(0x00281050, 0.5 * (darkest + lightest));               // Window Center
  image.number(0x00281051, std::max(1.0, 1.0 * lightest - darkest));  // Window Width
}

/// The patient's sides that a direction points to by more than a few degrees, the main one first, such as LP.
std::string sides(const glm::dvec3& direction) {
  std::vector<std::pair<double, char>> found;
  constexpr char kPositive[] = "LPH", kNegative[] = "RAF";
  for (int axis = 0; axis < 3; ++axis)
    if (const double along = direction[axis]; std::abs(along) > 0.1)
      found.emplace_back(std::abs(along), along > 0 ? kPositive[axis] : kNegative[axis]);
  std::ranges::stable_sort(found, std::greater{}, &std::pair<double, char>::first);
  std::string letters;
  for (const auto& [along, letter] : found) letters += letter;
  return letters;
}

void add_acquisition(DicomElements& image, const XaOptions& options,
                     const std::optional<XaExposure>& exposure) {
  image.text(0x00080060, "XA");
  image.text(0x00180060, "");  // KVP
  if (exposure) {
    const double seconds = exposure->pulse_ms / 1000;
    image.number(0x00180060, exposure->kvp);
    image.text(0x00181155, exposure->is_fluoroscopy ? "SC" : "GR");           // Radiation Setting
    image.number(0x00181151, std::round(exposure->mas / seconds));            // X-Ray Tube Current, mA
    image.number(0x00181150, std::max(1.0, std::round(exposure->pulse_ms)));  // Exposure Time, ms
    image.number(0x00181152, std::round(exposure->mas));                      // Exposure, mAs
    image.number(0x00181153, std::round(1000 * exposure->mas));               // Exposure in uAs
    image.number(0x00181154, exposure->pulse_ms);                             // Average Pulse Width
    image.text(0x0018115a, "PULSED");                                         // Radiation Mode
    constexpr double kDecigray = 10;
    image.number(0x0018115e, kDecigray * exposure->dap_Gycm2);  // Image and Fluoroscopy Area Dose Product
    return;
  }
  if (options.tube_kvp) image.number(0x00180060, *options.tube_kvp);
  image.text(0x00181155, options.is_fluoroscopy ? "SC" : "GR");  // Radiation Setting
  image.text(0x00181151, "");                                    // X-Ray Tube Current
  image.text(0x00181150, "");                                    // Exposure Time
  image.text(0x00181152, "");                                    // Exposure
}

void add_pose(DicomElements& image, std::span<const View> views) {
  const View& first = views.front();
  image.number(0x00181510, positioner_deg(first.lao_rad));
  image.number(0x00181511, positioner_deg(first.cranial_rad));
  image.text(0x00200060, "");  // Laterality
  // Of rows and columns; a rotating run has no single orientation.
  image.text(0x00200020, views.size() == 1 ? sides(first.right()) + '\\' + sides(-first.up()) : "");
  image.numbers(0x00181164, std::vector{first.pixel_mm, first.pixel_mm});  // Imager Pixel Spacing
  if (first.cone) {
    image.number(0x00181110, first.cone->source_detector_mm);
    image.number(0x00181111, first.cone->source_axis_mm);
    image.number(0x00181114, first.cone->source_detector_mm / first.cone->source_axis_mm);
  }
  if (views.size() == 1) return;
  const bool is_turning = std::ranges::any_of(views, [&](const View& view) {
    return view.lao_rad != first.lao_rad || view.cranial_rad != first.cranial_rad;
  });
  image.text(0x00181500, is_turning ? "DYNAMIC" : "STATIC");  // Positioner Motion
  if (!is_turning) return;
  // Offsets from the first frame, one per frame (C.8.7.5.1.3), continuous beyond half a turn.
  std::vector<double> primary_deg, secondary_deg;
  for (const View& view : views) {
    primary_deg.push_back(xa_degrees(view.lao_rad - first.lao_rad));
    secondary_deg.push_back(xa_degrees(view.cranial_rad - first.cranial_rad));
  }
  image.numbers(0x00181520, primary_deg);
  image.numbers(0x00181521, secondary_deg);
}

/// From each picture to the next, the first 0; none where they are evenly spaced, to half a millisecond, or
/// not all told.
std::vector<double> uneven_steps_ms(std::span<const double> times_s, std::size_t frames,
                                    double frame_time_ms) {
  constexpr double kEven_ms = 1.5;  // runs step by the millisecond, and pulses need not
  if (times_s.size() != frames) return {};
  std::vector<double> steps_ms{0};
  bool is_even = true;
  for (std::size_t i = 1; i < frames; ++i) {
    steps_ms.push_back(1e-3 * std::round(1e6 * (times_s[i] - times_s[i - 1])));  // to a microsecond
    is_even = is_even && std::abs(steps_ms.back() - frame_time_ms) <= kEven_ms;
  }
  return is_even ? std::vector<double>() : steps_ms;
}

void add_run(DicomElements& image, std::size_t frames, double frame_time_ms,
             std::span<const double> times_s) {
  if (frames == 1) return;
  image.number(0x00280008, static_cast<double>(frames));
  const std::vector<double> steps_ms = uneven_steps_ms(times_s, frames, frame_time_ms);
  const std::uint16_t element = steps_ms.empty() ? 0x1063 : 0x1065;
  image.words(0x00280009, std::vector<std::uint16_t>{0x0018, element});  // Frame Increment Pointer
  if (steps_ms.empty())
    image.number(0x00181063, frame_time_ms);  // Frame Time
  else
    image.numbers(0x00181065, steps_ms);  // Frame Time Vector
}

/// C.7.6.10: the frames behind the mask are shown subtracted.
void add_mask(DicomElements& image, std::size_t frames, int mask_frames) {
  if (mask_frames <= 0 || static_cast<std::size_t>(mask_frames) >= frames) return;
  std::vector<std::uint16_t> numbers;
  for (int frame = 1; frame <= mask_frames; ++frame) numbers.push_back(static_cast<std::uint16_t>(frame));
  const std::vector<std::uint16_t> applicable{static_cast<std::uint16_t>(mask_frames + 1),
                                              static_cast<std::uint16_t>(frames)};
  DicomElements mask;
  mask.text(0x00286101, "AVG_SUB");    // Mask Operation
  mask.words(0x00286102, applicable);  // Applicable Frame Range
  mask.words(0x00286110, numbers);     // Mask Frame Numbers
  mask.word(0x00286112, 1);            // Contrast Frame Averaging
  image.sequence(0x00286100, {mask});
  image.text(0x00281090, "SUB");  // Recommended Viewing Mode
}

std::string derivation(const View& view, const XaOptions& options) {
  const char* const frame = !options.frame_of_reference_uid.empty() ? "the scan's"
                            : options.patient.is_given()            ? "new, since the patient was given"
                                                                    : "new, since the scan's is unknown";
  const glm::dvec3& c = view.centre_mm;
  return fmt::format(
      "Simulated by xraycast from a CT scan, a digitally reconstructed radiograph; not for clinical use. "
      "Isocentre in the scan: {:.4f} {:.4f} {:.4f} mm (LPS). The frame of reference is {}.{}",
      c.x, c.y, c.z, frame, view.cone ? "" : " The beam is parallel: it has no source.");
}

}  // namespace

bool is_xa(const std::filesystem::path& path) { return extension_of(path) == ".dcm"; }

void check_xa(const std::filesystem::path& path, const View& view, const XaOptions& options) {
  check(options.patient);
  if (const double tilt_deg = positioner_deg(view.cranial_rad); std::abs(tilt_deg) > 90)
    throw InputError(
        "{}: a tilt of {:g} deg; DICOM's Positioner Secondary Angle holds -90 to 90: turn by 180 deg instead",
        path.string(), tilt_deg);
}

XaWriter::XaWriter(std::filesystem::path path, const View& view, std::int64_t frames, XaOptions options)
    : file_(std::move(path)), options_(std::move(options)) {
  check_xa(file_.target(), view, options_);
  const std::int64_t pixels = std::int64_t{view.width} * view.height;
  const std::int64_t most = kMostDicomPixels_B / (pixels * static_cast<std::int64_t>(sizeof(std::uint16_t)));
  if (frames > most)
    throw InputError(
        "{}: {} frames of {} x {} pixels; one DICOM file holds at most {}: draw fewer or smaller frames",
        file_.target().string(), frames, view.width, view.height, most);
  if (options_.is_subtracted && frames > kMostMaskedFrames)
    throw InputError("{}: {} frames; DICOM counts those of a run with a mask up to {}: draw fewer frames",
                     file_.target().string(), frames, kMostMaskedFrames);
  pixels_.reserve(static_cast<std::size_t>(pixels * frames));
}

void XaWriter::add(const View& view, std::span<const float> tau) {
  views_.push_back(view);
  for (const float depth : tau) pixels_.push_back(pixel_of(depth, options_.intensity));
}

void XaWriter::add_codes(const View& view, std::span<const std::uint16_t> codes) {
  views_.push_back(view);
  pixels_.insert(pixels_.end(), codes.begin(), codes.end());
}

void XaWriter::tell_instant(double time_s, bool has_r_wave) {
  times_s_.push_back(time_s);
  const std::size_t number = views_.size();
  if (has_r_wave && number <= kMostMaskedFrames) r_waves_.push_back(static_cast<std::uint16_t>(number));
}

void XaWriter::finish() {
  if (views_.empty()) return;
  const std::string& scans_frame = options_.frame_of_reference_uid;
  DicomElements image = dicom_elements("1.2.840.10008.5.1.4.1.1.12.1", options_.patient);
  image.text(0x00080008, "DERIVED\\SECONDARY\\SINGLE PLANE");  // Image Type
  image.text(0x00082111, derivation(views_.front(), options_));
  image.text(0x0008103e, "Simulated projection");  // Series Description
  image.text(0x00200052, scans_frame.empty() ? new_dicom_uid() : scans_frame);
  image.text(0x00201040, "");  // Position Reference Indicator
  add_image(image, views_.front(), pixels_, options_);
  add_acquisition(image, options_, exposure_);
  add_pose(image, views_);
  if (!options_.scan_options.empty()) image.text(0x00180022, options_.scan_options);
  add_run(image, views_.size(), options_.frame_time_ms, times_s_);
  if (views_.size() > 1 && !r_waves_.empty()) image.words(0x00286040, r_waves_);  // R Wave Pointer
  if (options_.is_subtracted) add_mask(image, views_.size(), mask_frames_);
  write_dicom(image, std::as_bytes(std::span(pixels_)), file_);
}

}  // namespace xraycast
