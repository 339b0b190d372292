#pragma once

#include "xraycast/geometry/mesh.hpp"

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace xraycast {

/// Whether a header or a comment of a file says that its points are RAS, as 3D Slicer marks its files.
inline bool says_ras(std::string_view text) { return text.find("SPACE=RAS") != std::string_view::npos; }

/// The same of either space.
inline bool says_space(std::string_view text) {
  return says_ras(text) || text.find("SPACE=LPS") != std::string_view::npos;
}

/// Collects the surface of a file that is not trusted, in LPS. All functions throw InputError, naming the
/// file, what it calls the field, and its number.
class MeshBuilder {
 public:
  explicit MeshBuilder(std::string name) : name_(std::move(name)) {}

  /// Points that are added from now on are in the space that a comment says, if it says one.
  void read_space(std::string_view comment) {
    if (!says_space(comment)) return;
    mesh_.says_space = true;
    sign_ = says_ras(comment) ? -1 : 1;
  }

  /// Refuses a point that no body has.
  void add_point(const glm::dvec3& stored_mm, const char* field);

  /// As a fan of triangles. Points may be added later.
  void add_polygon(std::span<const std::uint32_t> corners, const char* field, std::size_t number);

  /// Every other triangle of a strip runs backwards.
  void add_strip(std::span<const std::uint32_t> corners);

  std::size_t points() const { return mesh_.points_mm.size(); }

  /// Refuses corners that are none of the points.
  Mesh take();

 private:
  std::string name_;
  double sign_ = 1;
  Mesh mesh_;
};

/// Throws InputError, naming the file, the field and its number, for a point that no body has.
void check_surface_point(const glm::dvec3& point_mm, std::string_view file, const char* field,
                         std::size_t number);

}  // namespace xraycast
