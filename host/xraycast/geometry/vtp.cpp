// "VTK XML file formats", https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html
#include "xraycast/geometry/vtp.hpp"

#include "xraycast/base/base64.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/vtk_xml.hpp"
#include "xraycast/base/whole_file.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <sstream>
#include <zlib.h>

namespace xraycast {
namespace {

static_assert(std::endian::native == std::endian::little,
              "arrays are copied to and from little-endian files as is");

constexpr std::array<std::pair<const char*, PolyData::Cells PolyData::*>, 4> kCellKinds = {
    {{"Verts", &PolyData::verts},
     {"Lines", &PolyData::lines},
     {"Strips", &PolyData::strips},
     {"Polys", &PolyData::polys}}};

// ---- writing --------------------------------------------------------------------------------------------

template <typename T>
void append_bytes(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

template <typename T>
std::string encoded_as(std::span<const double> values) {
  std::string bytes;
  bytes.reserve(sizeof(std::uint64_t) + values.size() * sizeof(T));
  append_bytes<std::uint64_t>(bytes, values.size() * sizeof(T));
  for (const double value : values) append_bytes(bytes, static_cast<T>(value));
  return to_base64(bytes);
}

void write_array(pugi::xml_node parent, const PolyData::Array& array) {
  struct Encoding {
    const char* name;
    std::string (*encode)(std::span<const double>);
  };
  static constexpr Encoding kEncodings[] = {{"Float32", encoded_as<float>},
                                            {"Float64", encoded_as<double>},
                                            {"Int32", encoded_as<std::int32_t>},
                                            {"Int64", encoded_as<std::int64_t>}};
  const Encoding& encoding = kEncodings[static_cast<std::size_t>(array.type)];
  pugi::xml_node node = parent.append_child("DataArray");
  node.append_attribute("type") = encoding.name;
  node.append_attribute("Name") = array.name.c_str();
  node.append_attribute("NumberOfComponents") = array.components;
  node.append_attribute("format") = "binary";
  node.text() = encoding.encode(array.values).c_str();
}

void write_cells(pugi::xml_node parent, const PolyData::Cells& cells) {
  write_array(parent, {"connectivity", VtkType::kInt64, 1, {cells.points.begin(), cells.points.end()}});
  write_array(parent, {"offsets", VtkType::kInt64, 1, {cells.ends.begin(), cells.ends.end()}});
}

// ---- reading --------------------------------------------------------------------------------------------

class VtpReader {
 public:
  explicit VtpReader(const std::filesystem::path& path) : file_(path, "PolyData") {}

  PolyData read() {
    const pugi::xml_node piece = file_.piece();
    PolyData data;

    // Points first: the indices of all cells are checked against their number.
    const std::uint64_t points = file_.count(piece, "NumberOfPoints");
    const pugi::xml_node point_array = piece.child("Points").child("DataArray");
    const std::vector<double> coordinates = file_.values(point_array, "Points", 3 * points);
    data.points_mm.resize(points);
    const std::string space = file_.space();
    const double sign = space == "RAS" ? -1 : 1;
    data.says_space = !space.empty();
    for (std::size_t i = 0; i < points; ++i) {
      const double x = coordinates[3 * i], y = coordinates[3 * i + 1], z = coordinates[3 * i + 2];
      if (!std::isfinite(x) || !std::isfinite(y) || !std::isfinite(z))
        file_.fail("Points", "point {} is not finite", i);
      data.points_mm[i] = {sign * x, sign * y, z};
    }

    std::uint64_t cells = 0;
    for (const auto& [kind, member] : kCellKinds) {
      data.*member = read_cells(piece.child(kind), kind,
                                file_.count(piece, (std::string("NumberOf") + kind).c_str()), points);
      cells += (data.*member).size();
    }
    data.point_arrays = read_arrays(piece.child("PointData"), points);
    data.cell_arrays = read_arrays(piece.child("CellData"), cells);
    return data;
  }

 private:
  PolyData::Cells read_cells(pugi::xml_node section, const std::string& kind, std::uint64_t size,
                             std::uint64_t points) const {
    PolyData::Cells cells;
    if (size == 0) return cells;
    const std::string offsets_name = kind + " offsets", connectivity_name = kind + " connectivity";
    std::uint64_t end = 0;
    for (const double offset :
         file_.values(section.find_child_by_attribute("Name", "offsets"), offsets_name, size)) {
      if (!is_index(offset, std::numeric_limits<std::uint32_t>::max()) || offset < static_cast<double>(end))
        file_.fail(offsets_name, "{} is not a valid end of cell {}", offset, cells.ends.size());
      end = static_cast<std::uint64_t>(offset);
      cells.ends.push_back(end);
    }
    for (const double point :
         file_.values(section.find_child_by_attribute("Name", "connectivity"), connectivity_name, end)) {
      if (!is_index(point, points))
        file_.fail(connectivity_name, "{} is not one of {} points", point, points);
      cells.points.push_back(static_cast<std::uint32_t>(point));
    }
    return cells;
  }

  static bool is_index(double value, std::uint64_t size) {
    return value >= 0 && value < static_cast<double>(size) && value == std::floor(value);
  }

  std::vector<PolyData::Array> read_arrays(pugi::xml_node section, std::uint64_t tuples) const {
    std::vector<PolyData::Array> arrays;
    for (const pugi::xml_node node : section.children("DataArray")) {
      PolyData::Array array;
      array.name = node.attribute("Name").value();
      const std::uint64_t components = file_.count(node, "NumberOfComponents", 1);
      array.components = static_cast<int>(components);
      array.values = file_.values(node, array.name, tuples * components);
      arrays.push_back(std::move(array));
    }
    return arrays;
  }

  VtkXmlFile file_;
};

}  // namespace

const PolyData::Array* find_array(const std::vector<PolyData::Array>& arrays, std::string_view name) {
  const auto found = std::ranges::find(arrays, name, &PolyData::Array::name);
  return found == arrays.end() ? nullptr : &*found;
}

void write_vtp(const PolyData& data, const std::filesystem::path& path) {
  pugi::xml_document document;
  pugi::xml_node file = document.append_child("VTKFile");
  file.append_attribute("type") = "PolyData";
  file.append_attribute("version") = "1.0";
  file.append_attribute("byte_order") = "LittleEndian";
  file.append_attribute("header_type") = "UInt64";
  pugi::xml_node polydata = file.append_child("PolyData");

  pugi::xml_node space = polydata.append_child("FieldData").append_child("Array");
  space.append_attribute("type") = "String";
  space.append_attribute("Name") = "SPACE";
  space.append_attribute("NumberOfTuples") = 1;
  space.append_attribute("format") = "ascii";
  space.text() = "76 80 83 0";  // "LPS"

  pugi::xml_node piece = polydata.append_child("Piece");
  piece.append_attribute("NumberOfPoints") = data.points_mm.size();
  for (const auto& [kind, member] : kCellKinds)
    piece.append_attribute((std::string("NumberOf") + kind).c_str()) = (data.*member).size();

  pugi::xml_node point_data = piece.append_child("PointData");
  for (const PolyData::Array& array : data.point_arrays) write_array(point_data, array);
  pugi::xml_node cell_data = piece.append_child("CellData");
  for (const PolyData::Array& array : data.cell_arrays) write_array(cell_data, array);

  PolyData::Array points{"Points", data.point_type, 3, {}};
  points.values.reserve(3 * data.points_mm.size());
  for (const glm::dvec3& point : data.points_mm)
    points.values.insert(points.values.end(), {point.x, point.y, point.z});
  write_array(piece.append_child("Points"), points);
  for (const auto& [kind, member] : kCellKinds) write_cells(piece.append_child(kind), data.*member);

  std::ostringstream xml;
  document.save(xml, " ");
  write_whole_file(path, std::move(xml).str());
}

PolyData read_vtp(const std::filesystem::path& path) { return VtpReader(path).read(); }

}  // namespace xraycast
