#pragma once

#include <glm/vec3.hpp>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace xraycast {

/// The number types of written arrays. Readers accept all of VTK's.
enum class VtkType { kFloat32, kFloat64, kInt32, kInt64 };

/// VTK's vtkPolyData: points, cells between them, and named arrays over points and cells.
struct PolyData {
  /// `components` values per point or cell. Stored as double, which holds all indices and values exactly.
  struct Array {
    std::string name;
    VtkType type = VtkType::kFloat64;
    int components = 1;
    std::vector<double> values;
  };

  /// Cells of one kind, as runs of point indices.
  struct Cells {
    std::vector<std::uint32_t> points;  ///< those of all cells, one after the other
    std::vector<std::size_t> ends;      ///< where each cell's run ends

    std::size_t size() const { return ends.size(); }
    std::span<const std::uint32_t> operator[](std::size_t cell) const {
      const std::size_t begin = cell == 0 ? 0 : ends[cell - 1];
      return std::span(points).subspan(begin, ends[cell] - begin);
    }
    void add(std::span<const std::uint32_t> cell) {
      points.insert(points.end(), cell.begin(), cell.end());
      ends.push_back(points.size());
    }
  };

  VtkType point_type = VtkType::kFloat64;
  std::vector<glm::dvec3> points_mm;  ///< LPS
  Cells verts, lines, strips, polys;
  std::vector<Array> point_arrays;
  std::vector<Array>
      cell_arrays;          ///< in the order verts, lines, strips, polys (before strips in a legacy file)
  bool says_space = false;  ///< of a file: it says in which space its points are
};

/// The array of that name, or nullptr.
const PolyData::Array* find_array(const std::vector<PolyData::Array>& arrays, std::string_view name);

/// Writes VTK XML PolyData, version 1.0, with inline base64 arrays. The field array `SPACE`, where 3D Slicer
/// looks for the coordinate system, says LPS. Throws InputError when the target cannot be written, Error when
/// the disk is full.
void write_vtp(const PolyData& data, const std::filesystem::path& path);

/// Reads VTK XML PolyData of one piece: ASCII, inline base64 or appended (raw or base64), uncompressed or
/// zlib, little endian. Points of a file whose `SPACE` is RAS are converted to LPS. Arrays of strings are
/// skipped.
///
/// Nothing in the file is trusted: sizes are checked against the file's size before memory is allocated,
/// every array has its full length, cells index existing points, and points are finite. Throws InputError,
/// naming file and array.
PolyData read_vtp(const std::filesystem::path& path);

}  // namespace xraycast
