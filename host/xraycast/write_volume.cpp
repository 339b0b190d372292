#include "xraycast/atomic_file.hpp"
#include "xraycast/error.hpp"
#include "xraycast/scan.hpp"

#include <itkImage.h>
#include <itkImageFileWriter.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>

#include <algorithm>
#include <bit>
#include <fstream>
#include <optional>
#include <string_view>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

bool has_extension(const fs::path& path, std::string_view extension) {
  const std::string name = path.filename().string();
  return name.size() > extension.size() && name.ends_with(extension);
}

Error not_written(const fs::path& path) {
  return Error("{}: could not be written to its end; the disk may be full", path.string());
}

template <typename T>
void write_by_itk(itk::ImageIOBase* io, const VolumeGeometry& geometry, std::span<const T> voxels,
                  const fs::path& path) {
  AtomicFile file(path);
  using Image = itk::Image<T, 3>;
  const auto image = Image::New();
  typename Image::SizeType size;
  for (int axis = 0; axis < 3; ++axis)
    size[static_cast<unsigned>(axis)] = static_cast<std::size_t>(geometry.size[axis]);
  image->SetRegions(size);
  image->SetSpacing(&geometry.spacing_mm.x);
  image->SetOrigin(&geometry.origin_mm.x);
  // Only read from, and not ITK's to delete.
  image->GetPixelContainer()->SetImportPointer(const_cast<T*>(voxels.data()), voxels.size(), false);

  const auto writer = itk::ImageFileWriter<Image>::New();
  writer->SetInput(image);
  writer->SetImageIO(io);
  writer->SetFileName(file.temporary().string());
  writer->SetUseCompression(has_extension(path, ".gz"));
  try {
    writer->Update();
  } catch (const std::exception&) {
    throw not_written(path);
  }
  file.commit();
}

/// By hand, because ITK would name an .mhd's voxels after the temporary header, and print doubles short.
template <typename T>
void write_meta_image(const VolumeGeometry& geometry, std::span<const T> voxels, const fs::path& path) {
  AtomicFile header(path);
  std::optional<AtomicFile> data;
  if (has_extension(path, ".mhd")) data.emplace(fs::path(path).replace_extension(".raw"));

  const auto [size, spacing, origin] = geometry;
  std::ofstream stream(header.temporary(), std::ios::binary);
  stream
      << "ObjectType = Image\nNDims = 3\nBinaryData = True\nCompressedData = False\nBinaryDataByteOrderMSB = "
      << (std::endian::native == std::endian::big ? "True" : "False")
      << "\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nAnatomicalOrientation = RAI\n"
      << fmt::format("Offset = {} {} {}\n", origin.x, origin.y, origin.z)
      << fmt::format("ElementSpacing = {} {} {}\n", spacing.x, spacing.y, spacing.z)
      << fmt::format("DimSize = {} {} {}\n", size.x, size.y, size.z)
      << "ElementType = " << (sizeof(T) == 1 ? "MET_UCHAR" : "MET_SHORT")
      << "\nElementDataFile = " << (data ? data->target().filename().string() : "LOCAL") << "\n";
  std::ofstream raw;
  if (data) raw.open(data->temporary(), std::ios::binary);
  std::ofstream& voxel_stream = data ? raw : stream;
  voxel_stream.write(reinterpret_cast<const char*>(voxels.data()),
                     static_cast<std::streamsize>(voxels.size_bytes()));
  stream.close();
  if (data) raw.close();
  if (!stream || !raw) throw not_written(path);
  // The voxels first: a header never names a file that is not there.
  if (data) data->commit();
  header.commit();
}

template <typename T>
void write(const VolumeGeometry& geometry, std::span<const T> voxels, const fs::path& path) {
  check_volume_format(path);
  if (has_extension(path, ".nrrd"))
    write_by_itk(itk::NrrdImageIO::New(), geometry, voxels, path);
  else if (has_extension(path, ".nii") || has_extension(path, ".nii.gz"))
    write_by_itk(itk::NiftiImageIO::New(), geometry, voxels, path);
  else
    write_meta_image(geometry, voxels, path);
}

}  // namespace

void check_volume_format(const fs::path& path) {
  constexpr std::string_view kKnown[] = {".nrrd", ".nii", ".nii.gz", ".mha", ".mhd"};
  if (std::ranges::none_of(kKnown, [&](std::string_view extension) { return has_extension(path, extension); }))
    throw InputError("{}: not a volume's name; end it in .nrrd, .nii, .nii.gz, .mha or .mhd", path.string());
}

void write_volume(const Volume& volume, const fs::path& path, Progress& progress) {
  progress.begin("writing", volume.geometry().size.z, "slices");
  write(volume.geometry(), volume.hu(), path);
  progress.advance(volume.geometry().size.z);
}

void write_mask(const VolumeGeometry& geometry, std::span<const std::uint8_t> mask, const fs::path& path) {
  write(geometry, mask, path);
}

}  // namespace xraycast
