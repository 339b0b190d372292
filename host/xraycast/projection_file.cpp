#include "xraycast/projection_file.hpp"

#include "xraycast/atomic_file.hpp"
#include "xraycast/error.hpp"
#include "xraycast/image.hpp"

#include <OpenImageIO/imageio.h>
#include <itkImage.h>
#include <itkImageFileWriter.h>
#include <itkNrrdImageIO.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cctype>

namespace xraycast {
namespace {

using nlohmann::json;

json vector_to_json(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

json view_to_json(const View& view) {
  json out{{"label", label(view)},
           {"angle_rad", view.angle_rad},
           {"tilt_rad", view.tilt_rad},
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

/// EXR and TIFF.
void write_float_image(const ProjectionImage& image, const char* format, const AtomicFile& file) {
  const auto out = OIIO::ImageOutput::create(format);
  if (!out) throw Error("{}: OpenImageIO cannot write {}", file.target().string(), format);
  OIIO::ImageSpec spec(image.view.width, image.view.height, 1, OIIO::TypeDesc::FLOAT);
  spec.channelnames = {"tau"};
  spec.attribute("compression", "zip");
  spec.attribute("ImageDescription", "xraycast: optical depth tau; transmission is exp(-tau); view " +
                                         view_to_json(image.view).dump());
  spec.attribute("xraycast:view", view_to_json(image.view).dump());
  if (!out->open(file.temporary().string(), spec) ||
      !out->write_image(OIIO::TypeDesc::FLOAT, image.tau.data()) || !out->close())
    throw Error("{}: could not be written: {}", file.target().string(), out->geterror());
}

/// One slice in space: columns along the picture's right, rows downwards, on the detector.
void write_nrrd(const ProjectionImage& image, const AtomicFile& file) {
  using Image = itk::Image<float, 3>;
  const auto picture = Image::New();
  picture->SetRegions(Image::SizeType{{static_cast<itk::SizeValueType>(image.view.width),
                                       static_cast<itk::SizeValueType>(image.view.height), 1}});
  picture->Allocate();
  std::ranges::copy(image.tau, picture->GetBufferPointer());
  const glm::dvec3 axes[] = {image.view.right(), -image.view.up(), -image.view.towards_detector()};
  const glm::dvec3 origin = image.view.pixel_on_detector_mm(0, 0);
  Image::DirectionType direction;
  Image::PointType point;
  for (unsigned row = 0; row < 3; ++row) {
    point[row] = origin[static_cast<int>(row)];
    for (unsigned column = 0; column < 3; ++column)
      direction(row, column) = axes[column][static_cast<int>(row)];
  }
  picture->SetDirection(direction);
  picture->SetOrigin(point);
  const double spacing[] = {image.view.pixel_mm, image.view.pixel_mm, image.view.pixel_mm};
  picture->SetSpacing(spacing);
  const auto writer = itk::ImageFileWriter<Image>::New();
  writer->SetImageIO(itk::NrrdImageIO::New());
  writer->SetFileName(file.temporary().string());
  writer->SetInput(picture);
  try {
    writer->Update();
  } catch (const itk::ExceptionObject& error) {
    throw Error("{}: could not be written: {}", file.target().string(), error.GetDescription());
  }
}

std::string extension_of(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".tiff" ? ".tif" : extension;
}

}  // namespace

void check_projection_format(const std::filesystem::path& path) {
  const std::string extension = extension_of(path);
  if (extension != ".exr" && extension != ".png" && extension != ".nrrd" && extension != ".tif")
    throw InputError("{}: a projection is written as .exr, .tif, .nrrd (float) or .png (to look at)",
                     path.string());
}

void write_projection(const ProjectionImage& image, const std::filesystem::path& path) {
  check_projection_format(path);
  const std::string extension = extension_of(path);
  if (extension == ".png")
    return write_png(windowed_transmission(image.tau), image.view.width, image.view.height, 1, path);
  AtomicFile file(path);
  if (extension == ".nrrd") write_nrrd(image, file);
  if (extension == ".exr") write_float_image(image, "openexr", file);
  if (extension == ".tif") write_float_image(image, "tiff", file);
  file.commit();
}

}  // namespace xraycast
