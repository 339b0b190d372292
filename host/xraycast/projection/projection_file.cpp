#include "xraycast/projection/projection_file.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/image.hpp"
#include "xraycast/base/picture_file.hpp"
#include "xraycast/base/small_pictures.hpp"
#include "xraycast/base/whole_file.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <bit>

namespace xraycast {
namespace {

using nlohmann::json;

json vector_to_json(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

json view_to_json(const View& view) {
  json out{{"label", label(view)},
           {"lao_rad", view.lao_rad},
           {"cranial_rad", view.cranial_rad},
           {"centre_mm", vector_to_json(view.centre_mm)},
           {"pixel_mm", view.pixel_mm},
           {"first_pixel_mm", vector_to_json(view.pixel_on_detector_mm(0, 0))},
           {"right", vector_to_json(view.right())},
           {"up", vector_to_json(view.up())}};
  if (view.cone) {
    out["source_axis_mm"] = view.cone->source_axis_mm;
    out["source_detector_mm"] = view.cone->source_detector_mm;
    out["source_mm"] = vector_to_json(view.source_mm());
  }
  return out;
}

/// What the pixels of a float image are.
struct Quantity {
  const char* channel;
  const char* description;
};
constexpr Quantity kOpticalDepth{"tau", "optical depth tau; transmission is exp(-tau)"};
constexpr Quantity kDetectorSignal{"energy_kev",
                                   "simulated detector signal, absorbed energy of a pixel in keV"};

void write_float_image(const ProjectionImage& image, const Quantity& quantity,
                       const std::filesystem::path& path) {
  const std::string view = view_to_json(image.view).dump();
  // TIFF has no custom attributes, so the description holds everything.
  const std::string description = fmt::format("xraycast: {}; view {}", quantity.description, view);
  if (extension_of(path) != ".exr")
    return write_tiff(image.tau, image.view.width, image.view.height, description, path);
  const ExrPart part{.width = image.view.width,
                     .height = image.view.height,
                     .channels = {{quantity.channel, image.tau}},
                     .attributes = {{"comments", description}, {"xraycast:view", view}}};
  write_exr(std::span(&part, 1), path);
}

/// One slice in space: columns along the picture's right, rows downwards, on the detector.
void write_nrrd(const ProjectionImage& image, const std::filesystem::path& path) {
  static_assert(std::endian::native == std::endian::little, "the header says so");
  const View& view = image.view;
  const auto vector = [](const glm::dvec3& v) { return fmt::format("({},{},{})", v.x, v.y, v.z); };
  const std::string header = fmt::format(
      "NRRD0004\ntype: float\ndimension: 3\nspace: left-posterior-superior\nsizes: {} {} 1\n"
      "space directions: {} {} {}\nkinds: domain domain domain\nendian: little\nencoding: raw\n"
      "space origin: {}\n\n",
      view.width, view.height, vector(view.pixel_mm * view.right()), vector(-view.pixel_mm * view.up()),
      vector(-view.pixel_mm * view.towards_detector()), vector(view.pixel_on_detector_mm(0, 0)));
  const auto voxels = std::as_bytes(std::span(image.tau));
  write_whole_file(path, header + std::string(reinterpret_cast<const char*>(voxels.data()), voxels.size()));
}

void write_one_xa(const ProjectionImage& image, const std::filesystem::path& path, const XaOptions& options) {
  XaWriter writer(path, image.view, 1, options);
  writer.add(image.view, image.tau);
  writer.finish();
}

}  // namespace

bool is_picture(const std::filesystem::path& path) {
  constexpr std::array kValues{".exr", ".nrrd", ".tif", ".tiff"};
  return std::ranges::find(kValues, extension_of(path)) == kValues.end() && !is_xa(path);
}

void check_projection_format(const std::filesystem::path& path) {
  const std::string extension = extension_of(path);
  if (extension != ".exr" && extension != ".nrrd" && !is_xa(path) && !is_picture_name(path))
    throw InputError("{}: a single picture is written as .exr, .nrrd (float), .dcm (DICOM XA) or one of {}",
                     path.string(), picture_extensions());
}

void write_projection(const ProjectionImage& image, const std::filesystem::path& path, double gamma,
                      bool inverted, const XaOptions& xa) {
  check_projection_format(path);
  if (is_picture(path))
    return write_picture(windowed(image.tau, automatic_window(image.tau, gamma, inverted)), image.view.width,
                         image.view.height, 1, path);
  if (is_xa(path)) return write_one_xa(image, path, xa);
  if (extension_of(path) == ".nrrd") return write_nrrd(image, path);
  write_float_image(image, kOpticalDepth, path);
}

void write_detector_signal(const View& view, const std::vector<float>& signal_kev,
                           const std::filesystem::path& path) {
  check_projection_format(path);
  const ProjectionImage image{view, signal_kev, 0};
  if (extension_of(path) == ".nrrd") return write_nrrd(image, path);
  write_float_image(image, kDetectorSignal, path);
}

}  // namespace xraycast
