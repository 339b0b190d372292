#include "xraycast/geometry/stl.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/mesh_builder.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <string>
#include <string_view>
#include <unordered_map>

namespace xraycast {
namespace {

static_assert(std::endian::native == std::endian::little, "STL is little endian and copied as it stands");
constexpr std::size_t kStlHeader_B = 80, kStlStart_B = kStlHeader_B + sizeof(std::uint32_t);

/// A triangle of a binary STL, without the padding that a compiler would add at the end.
struct StlTriangle {
  glm::vec3 normal;
  std::array<glm::vec3, 3> corners_mm;
};
constexpr std::size_t kStlTriangle_B =
    sizeof(StlTriangle) + sizeof(std::uint16_t);  // two unused bytes follow
static_assert(kStlTriangle_B == 50);

/// Collects an STL's triangles, which name their corners by position: equal positions become one point, so
/// that neighbours share it again.
class StlMesh {
 public:
  StlMesh(std::string_view name, std::string_view header)
      : name_(name), sign_(says_ras(header) ? -1.0f : 1.0f) {
    mesh_.says_space = says_space(header);
  }

  void add(const std::array<glm::vec3, 3>& corners_mm) {
    std::array<std::uint32_t, 3> triangle{};
    for (std::size_t k = 0; k < 3; ++k) triangle[k] = point(corners_mm[k]);
    mesh_.triangles.push_back(triangle);
  }

  Mesh take() { return std::move(mesh_); }

 private:
  struct Hash {
    std::size_t operator()(const glm::vec3& p) const {
      std::size_t hash = 0;
      for (const float x : {p.x, p.y, p.z})
        hash = (hash ^ std::bit_cast<std::uint32_t>(x)) * 0x9e3779b97f4a7c15;
      return hash ^ hash >> 32;
    }
  };

  std::uint32_t point(const glm::vec3& stored) {
    check_surface_point(stored, name_, "a corner of triangle", mesh_.triangles.size());
    // Adding zero turns -0 into 0, which compares equal but has another hash.
    const glm::vec3 position = glm::vec3(sign_ * stored.x, sign_ * stored.y, stored.z) + 0.0f;
    const auto [entry, added] =
        index_.try_emplace(position, static_cast<std::uint32_t>(mesh_.points_mm.size()));
    if (added) mesh_.points_mm.push_back(position);
    return entry->second;
  }

  std::string_view name_;
  float sign_;  ///< of x and y: a file marked RAS is converted to LPS
  Mesh mesh_;
  std::unordered_map<glm::vec3, std::uint32_t, Hash> index_;
};

Mesh read_binary_stl(std::string_view bytes, const std::string& name) {
  if (bytes.size() < kStlStart_B) throw InputError("{}: too short for an STL: {} bytes", name, bytes.size());
  std::uint32_t count = 0;
  std::memcpy(&count, bytes.data() + kStlHeader_B, sizeof count);
  if (const std::size_t room = (bytes.size() - kStlStart_B) / kStlTriangle_B; count > room)
    throw InputError("{}: the header claims {} triangles, but the file ends after {}", name, count, room);
  StlMesh mesh(name, bytes.substr(0, kStlHeader_B));
  for (std::size_t i = 0; i < count; ++i) {
    StlTriangle triangle;
    std::memcpy(&triangle, bytes.data() + kStlStart_B + i * kStlTriangle_B, sizeof triangle);
    mesh.add(triangle.corners_mm);
  }
  return mesh.take();
}

glm::vec3 parse_vertex(std::string_view numbers, const std::string& name, std::size_t line) {
  glm::vec3 vertex;
  for (int axis = 0; axis < 3; ++axis) {
    numbers.remove_prefix(std::min(numbers.find_first_not_of(" \t+"), numbers.size()));
    const auto [rest, error] = std::from_chars(numbers.data(), numbers.data() + numbers.size(), vertex[axis]);
    if (error != std::errc()) throw InputError("{}: line {}: a vertex needs three numbers", name, line);
    numbers.remove_prefix(static_cast<std::size_t>(rest - numbers.data()));
  }
  return vertex;
}

Mesh read_ascii_stl(std::string_view text, const std::string& name) {
  StlMesh mesh(name, trimmed(take_line(text)));
  std::array<glm::vec3, 3> corners_mm;
  std::size_t corners = 0;
  bool ended = false;
  for (std::size_t number = 2; !text.empty(); ++number) {
    const std::string_view line = trimmed(take_line(text));
    if (line.starts_with("vertex")) {
      const glm::vec3 vertex = parse_vertex(line.substr(6), name, number);
      if (corners < 3) corners_mm[corners] = vertex;
      ++corners;
    } else if (line.starts_with("endfacet")) {
      if (corners != 3)
        throw InputError("{}: line {}: a facet of {} instead of 3", name, number,
                         pluralize(corners, "corner"));
      mesh.add(corners_mm);
      corners = 0;
    }
    ended = line.starts_with("endsolid") || (ended && line.empty());
  }
  if (!ended) throw InputError("{}: truncated: it does not end with \"endsolid\"", name);
  return mesh.take();
}

}  // namespace

void write_stl(const Mesh& mesh, const std::filesystem::path& path) {
  std::string bytes = "xraycast SPACE=LPS";
  bytes.resize(kStlStart_B + mesh.triangles.size() * kStlTriangle_B);
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  std::memcpy(bytes.data() + kStlHeader_B, &count, sizeof count);
  char* next = bytes.data() + kStlStart_B;
  for (const auto& [a, b, c] : mesh.triangles) {
    StlTriangle triangle{{}, {mesh.points_mm[a], mesh.points_mm[b], mesh.points_mm[c]}};
    const auto& corners = triangle.corners_mm;
    const glm::dvec3 normal = glm::cross(glm::dvec3(corners[1]) - glm::dvec3(corners[0]),
                                         glm::dvec3(corners[2]) - glm::dvec3(corners[0]));
    if (const double length = glm::length(normal); length > 0) triangle.normal = normal / length;
    std::memcpy(next, &triangle, sizeof triangle);
    next += kStlTriangle_B;
  }
  write_whole_file(path, bytes);
}

Mesh read_stl(const std::filesystem::path& path) {
  const std::string bytes = read_whole_file(path);
  // Some programs start their binary files with "solid" too; then only the size distinguishes them.
  std::uint32_t count = 0;
  if (bytes.size() >= kStlStart_B) std::memcpy(&count, bytes.data() + kStlHeader_B, sizeof count);
  const bool binary = bytes.size() == kStlStart_B + count * kStlTriangle_B || !bytes.starts_with("solid");
  return binary ? read_binary_stl(bytes, path.string()) : read_ascii_stl(bytes, path.string());
}

}  // namespace xraycast
