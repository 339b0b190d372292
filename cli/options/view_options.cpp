#include "options/view_options.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/projection/projection_file.hpp"

#include <glm/trigonometric.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast::cli {
namespace {

/// Degrees of an angle that was given in degrees: without the rounding of the conversion to radians and back.
double degrees(double radians) { return std::round(glm::degrees(radians) * 1e9) / 1e9; }

}  // namespace

void add_view_options(CLI::App& command, ViewOptions& options) {
  options.angle =
      command
          .add_option("--angle,--lao", options.angle_deg,
                      "C-arm angle, the position of the detector: LAO positive, RAO negative, 0 frontal (AP)")
          ->capture_default_str()
          ->type_name("DEG");
  options.tilt = command
                     .add_option("--tilt,--cranial", options.tilt_deg,
                                 "Tilt of the detector: cranial positive, caudal negative")
                     ->capture_default_str()
                     ->type_name("DEG");
  command
      .add_option(
          "--isocentre", options.isocentre,
          "Isocentre, the middle of the picture: a point within the body in patient coordinates (LPS, mm); "
          "the picture's size stays the same; default: the middle of the body")
      ->type_name("X,Y,Z");
  add_cone_option(command, options.cone);
  command.add_option("--size", options.size, "Picture size in pixels; default: the whole body fits")
      ->type_name("WxH");
  command
      .add_option("--pixel", options.pixel_mm,
                  "Pixel size on the detector; default: as fine as the scan, or with --size so that the "
                  "whole body fits")
      ->check(CLI::PositiveNumber)
      ->type_name("MM");
}

void add_grey_options(CLI::App& command, GreyOptions& options) {
  command.add_option("--gamma", options.gamma, "Gamma of the displayed greys")
      ->check(CLI::Range(0.1, 10.0))
      ->type_name("GAMMA");
  command.add_flag("--inverted", options.inverted, "Show bone bright instead of dark");
}

void check_shown(bool is_given, const char* option, const std::string& file) {
  if (is_given && !is_picture(file))
    throw InputError(
        "{} does not apply to {}, which holds values that are not displayed; leave it out or write a .png",
        option, file);
}

void check_shown(const GreyOptions& options, const std::string& file) {
  check_shown(options.gamma.has_value(), "--gamma", file);
  check_shown(options.inverted, "--inverted", file);
}

void add_patient_option(CLI::App& command, std::string& patient) {
  command
      .add_option("--patient", patient,
                  "Patient's name and ID in DICOM files, such as Doe^Jane,12345; default: none")
      ->type_name("NAME,ID");
}

void add_dicom_options(CLI::App& command, DicomOptions& options) {
  add_patient_option(command, options.patient);
  command
      .add_option("--intensity", options.intensity,
                  ".dcm: pixel values follow the X-ray intensity (linear) or its logarithm (log, default, "
                  "which keeps all depths distinct in 12 bits)")
      ->check(CLI::IsMember({"log", "linear"}))
      ->type_name("NAME");
}

XaOptions parse_xa(const DicomOptions& options, const std::string& file) {
  if (!is_xa(file) && !(options.patient.empty() && options.intensity.empty()))
    throw InputError("{} does not apply to {}, which is not DICOM; leave it out or write a .dcm",
                     options.patient.empty() ? "--intensity" : "--patient", file);
  XaOptions xa;
  if (options.intensity == "linear") xa.intensity = XaIntensity::linear;
  xa.patient = parse_patient(options.patient, "--patient");
  return xa;
}

void check_dicom(const View& view, const XaOptions& xa, const std::string& file,
                 const Invocation& invocation) {
  if (!is_xa(file)) return;
  check_xa(file, view, xa);
  if (!view.cone)
    invocation.say({file +
                    ": a parallel beam has no source, so the file holds no source distances; give --cone "
                    "for a C-arm's"});
}

std::string frame_of_reference_name(const XaOptions& xa) {
  return xa.frame_of_reference_uid.empty() ? "new" : "scan";
}

void add_cone_option(CLI::App& command, std::string& cone) {
  command
      .add_option(
          "--cone", cone,
          "Distances from the source to the isocentre and to the detector (SID); without it the beam is "
          "parallel")
      ->type_name("MM,MM");
}

std::optional<Cone> parse_cone(const std::string& cone) {
  if (cone.empty()) return std::nullopt;
  const std::vector<double> distances = parse_numbers(cone, "--cone");
  if (distances.size() != 2) throw InputError("--cone {}: must be SOURCE_AXIS_MM,SOURCE_DETECTOR_MM", cone);
  return Cone{distances[0], distances[1]};
}

std::vector<double> parse_angles_deg(const std::string& text, const std::string& option) {
  std::string numbers = text;
  std::ranges::replace(numbers, ':', ',');
  const std::vector<double> range = parse_numbers(numbers, option);
  if (range.size() != 3 || range[2] == 0 || (range[1] - range[0]) / range[2] <= 0)
    throw InputError("{} {}: must be FROM:TO:STEP in degrees", option, text);
  const double count = std::ceil((range[1] - range[0]) / range[2] - 1e-9);
  constexpr double kMost = 3600;
  if (count > kMost) throw InputError("{} {}: more than {} angles; use a larger step", option, text, kMost);
  std::vector<double> angles;
  for (int i = 0; i < static_cast<int>(count); ++i) angles.push_back(range[0] + i * range[2]);
  return angles;
}

namespace {

glm::dvec3 parse_isocentre(const std::string& isocentre) {
  const std::vector<double> place = parse_numbers(isocentre, "--isocentre");
  if (place.size() != 3) throw InputError("--isocentre {}: must be X,Y,Z in mm", isocentre);
  return {place[0], place[1], place[2]};
}

}  // namespace

View parse_view(const ViewOptions& options) {
  if (options.has_isocentre()) parse_isocentre(options.isocentre);  // before long work
  View view;
  view.lao_rad = glm::radians(options.angle_deg);
  view.cranial_rad = glm::radians(options.tilt_deg);
  view.pixel_mm = options.pixel_mm;
  view.cone = parse_cone(options.cone);
  if (!options.size.empty()) {
    const auto size = parse_sizes(options.size, 2, "--size");
    view.width = static_cast<int>(size[0]);
    view.height = static_cast<int>(size[1]);
  }
  return view;
}

glm::dvec3 isocentre_mm(const ViewOptions& options, const BodyBounds& bounds) {
  if (!options.has_isocentre()) return bounds.centre_mm;
  const glm::dvec3 place_mm = parse_isocentre(options.isocentre);
  if (const glm::dvec3& middle_mm = bounds.centre_mm; !bounds.holds(place_mm))
    throw InputError(
        "--isocentre {}: lies outside the body, whose middle is {:.0f},{:.0f},{:.0f} (LPS, mm), radius "
        "{:.0f} mm and height {:.0f} mm; choose a place within it",
        options.isocentre, middle_mm.x, middle_mm.y, middle_mm.z, bounds.radius_mm,
        2 * bounds.half_height_mm);
  return place_mm;
}

Json to_json(const View& view) {
  return {{"width", view.width},
          {"height", view.height},
          {"pixel_mm", view.pixel_mm},
          {"centre_mm", {view.centre_mm.x, view.centre_mm.y, view.centre_mm.z}},
          {"angle_deg", degrees(view.lao_rad)},
          {"tilt_deg", degrees(view.cranial_rad)}};
}

}  // namespace xraycast::cli
