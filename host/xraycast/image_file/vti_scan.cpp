#include "xraycast/base/error.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/base/vtk_xml.hpp"
#include "xraycast/image_file/image_file_scan.hpp"
#include "xraycast/image_file/image_file_stack.hpp"

#include <algorithm>
#include <cmath>
#include <map>

// "VTK XML file formats", https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html
namespace xraycast {
namespace {

VoxelType vti_type(const VtkXmlFile& file, const std::string& field, const std::string& name) {
  static const std::map<std::string, VoxelType> types{
      {"Int8", VoxelType::int8},      {"UInt8", VoxelType::uint8},   {"Int16", VoxelType::int16},
      {"UInt16", VoxelType::uint16},  {"Int32", VoxelType::int32},   {"UInt32", VoxelType::uint32},
      {"Int64", VoxelType::int64},    {"UInt64", VoxelType::uint64}, {"Float32", VoxelType::float32},
      {"Float64", VoxelType::float64}};
  const auto found = types.find(name);
  if (found == types.end()) file.fail(field, "the type \"{}\" is not supported", excerpt(name));
  return found->second;
}

/// The active scalars, or else the first array.
pugi::xml_node scalars_of(const VtkXmlFile& file) {
  const pugi::xml_node section = file.piece().child("PointData");
  const char* const active = section.attribute("Scalars").value();
  pugi::xml_node array = section.find_child_by_attribute("DataArray", "Name", active);
  if (!array) array = section.child("DataArray");
  if (!array) file.fail("PointData", "holds no array; a scan has its values at the points");
  return array;
}

/// Indices of the first and the last voxel along x, y and z: {x0, x1, y0, y1, z0, z1}.
std::vector<double> extent_of(const VtkXmlFile& file) {
  std::vector<double> extent = file.attribute_numbers(file.piece(), "Extent", std::vector<double>(6, 0));
  constexpr double kMost = 1e9;
  for (const double index : extent)
    if (index != std::floor(index) || !(std::abs(index) < kMost))
      file.fail("Extent", "holds {}, which is not a valid index", index);
  return extent;
}

/// Sizes and place; VTK's Direction holds the axes as columns.
void read_grid(const VtkXmlFile& file, ImageHeader& header) {
  const std::vector<double> extent = extent_of(file);
  const std::vector<double> spacing = file.attribute_numbers(file.data(), "Spacing", {1, 1, 1});
  const std::vector<double> origin = file.attribute_numbers(file.data(), "Origin", {0, 0, 0});
  const std::vector<double> direction =
      file.attribute_numbers(file.data(), "Direction", {1, 0, 0, 0, 1, 0, 0, 0, 1});
  require_spacing(header.path, "Spacing", spacing);
  for (const double number : origin)
    if (!std::isfinite(number)) file.fail("Origin", "holds {}", number);
  const double sign = file.space() == "RAS" ? -1 : 1;
  const glm::dvec3 to_lps(sign, sign, 1);
  header.origin_mm = to_lps * glm::dvec3(origin[0], origin[1], origin[2]);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double first = extent[2 * axis], last = extent[2 * axis + 1];
    header.size.push_back(static_cast<std::int64_t>(last - first) + 1);
    header.step_mm[axis] =
        to_lps * spacing[axis] * glm::dvec3(direction[axis], direction[3 + axis], direction[6 + axis]);
    header.origin_mm += first * header.step_mm[axis];
  }
}

/// How many bytes a scan of that size takes; sizes that are none are refused later.
std::uint64_t most_bytes(const ImageHeader& header) {
  constexpr std::int64_t kMaxSize = 65536;
  auto most_B = static_cast<std::uint64_t>(bytes_of(header.type));
  for (const std::int64_t size : header.size)
    most_B *= static_cast<std::uint64_t>(std::clamp<std::int64_t>(size, 0, kMaxSize));
  return most_B;
}

/// As bytes; those of ASCII are made float64. None of colours, which are refused.
LoadedVoxels load_voxels(const VtkXmlFile& file, ImageHeader& header) {
  const pugi::xml_node array = scalars_of(file);
  const std::string field = array.attribute("Name").value();
  header.type = vti_type(file, field, array.attribute("type").value());
  header.numbers_per_voxel = static_cast<std::int64_t>(file.count(array, "NumberOfComponents", 1));
  if (header.numbers_per_voxel != 1) return {};
  if (array.attribute("format").value() != std::string_view("ascii")) {
    header.is_big_endian = file.is_big_endian();
    return {file.bytes(array, field, most_bytes(header))};
  }
  header.type = VoxelType::float64;
  const std::vector<double> values = file.values(array, field, std::nullopt);
  return {std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double))};
}

}  // namespace

Scan open_vti(const std::filesystem::path& path, const ScanOptions& options, Progress& progress) {
  progress.begin("opening", 1, "files");
  return with_remedy(path, "export the file again", [&] {
    const VtkXmlFile file(path, "ImageData");
    ImageHeader header;
    header.path = path;
    read_grid(file, header);
    LoadedVoxels voxels = load_voxels(file, header);
    std::vector<std::string> warnings;
    if (file.space().empty()) warnings.push_back(unknown_orientation("no field array SPACE", header));
    progress.advance();
    return deliver_image({std::move(header), std::move(voxels), std::move(warnings)}, "VTK", options);
  });
}

bool is_vti(const std::string& leading_bytes) {
  const auto tag = leading_bytes.find("<VTKFile");
  return tag != std::string::npos && leading_bytes.find("ImageData", tag) != std::string::npos &&
         leading_bytes[leading_bytes.find_first_not_of(" \t\r\n\xef\xbb\xbf")] == '<';
}

}  // namespace xraycast
