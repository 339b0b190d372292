#pragma once

#include "options/command.hpp"
#include "xraycast/projection/view.hpp"
#include "xraycast/projection/xa_file.hpp"
#include "xraycast/sampling/c_arm_pose.hpp"

#include <optional>
#include <string>
#include <vector>

namespace xraycast::cli {

/// --angle, --tilt, --isocentre, --cone, --size and --pixel, as given.
struct ViewOptions {
  std::string isocentre, cone, size;
  double angle_deg = 0, tilt_deg = 0, pixel_mm = 0;
  const CLI::Option *angle = nullptr, *tilt = nullptr;  ///< whether they were given

  bool has_angle() const { return angle && angle->count() > 0; }
  bool has_tilt() const { return tilt && tilt->count() > 0; }
  bool has_isocentre() const { return !isocentre.empty(); }
};

void add_view_options(CLI::App& command, ViewOptions& options);

/// --gamma and --inverted, as given: the display of a picture's greys.
struct GreyOptions {
  std::optional<double> gamma;
  bool inverted = false;
};

void add_grey_options(CLI::App& command, GreyOptions& options);

/// Throws InputError when `option`, which affects only displayed pictures, was given for a file that holds
/// optical depths.
void check_shown(bool is_given, const char* option, const std::string& file);
void check_shown(const GreyOptions& options, const std::string& file);

/// --patient alone, for commands that draw nothing.
void add_patient_option(CLI::App& command, std::string& patient);

/// --patient and --intensity, as given: the options for DICOM pictures only.
struct DicomOptions {
  std::string patient, intensity;
};

void add_dicom_options(CLI::App& command, DicomOptions& options);

/// Throws InputError for a patient that is not NAME,ID, and when an option was given for a `file` that is not
/// DICOM.
XaOptions parse_xa(const DicomOptions& options, const std::string& file);

/// Where `file` is DICOM, checks that DICOM can represent the view and the patient, and notes why a parallel
/// beam's picture has no source distances. Throws InputError.
void check_dicom(const View& view, const XaOptions& xa, const std::string& file,
                 const Invocation& invocation);

/// "scan" or "new".
std::string frame_of_reference_name(const XaOptions& xa);

/// --cone alone, for commands that choose their own angles.
void add_cone_option(CLI::App& command, std::string& cone);

/// `1000,1500`, or none for an empty text. Throws InputError.
std::optional<Cone> parse_cone(const std::string& cone);

/// `0:360:5`: from the first to before the last, in steps. Throws InputError, naming the option.
std::vector<double> parse_angles_deg(const std::string& text, const std::string& option);

/// The view, without its centre; sizes that were not given are 0, for `fitted`. Throws InputError.
View parse_view(const ViewOptions& options);

/// --isocentre, or the middle of the body. Throws InputError for a place outside its bounds.
glm::dvec3 isocentre_mm(const ViewOptions& options, const BodyBounds& bounds);

/// {"width", "height", "pixel_mm", "centre_mm", "angle_deg", "tilt_deg"}.
Json to_json(const View& view);

}  // namespace xraycast::cli
