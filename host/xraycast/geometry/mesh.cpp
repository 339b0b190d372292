#include "xraycast/geometry/mesh.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/pluralize.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/body_bounds.hpp"
#include "xraycast/geometry/vtp.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <string>
#include <string_view>
#include <unordered_map>

namespace xraycast {
namespace {

/// Throws InputError, naming the file, the field and its index, for a point that no body has.
void check_point(const glm::dvec3& point_mm, std::string_view file, const char* field, std::size_t index) {
  for (int axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(point_mm[axis]))
      throw InputError("{}: {} {} is not finite; export the surface again", file, field, index);
    if (std::abs(point_mm[axis]) > kFarthest_mm)
      throw InputError("{}: {} {} lies {:g} mm from the origin, more than {:g}; export the surface in mm",
                       file, field, index, std::abs(point_mm[axis]), kFarthest_mm);
  }
}

// ---- STL ------------------------------------------------------------------------------------------------

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

/// Collects an STL's triangles, which name their corners by position: equal positions become one point, so
/// that neighbours share it again.
class StlMesh {
 public:
  StlMesh(std::string_view name, std::string_view header)
      : name_(name), sign_(header.find("SPACE=RAS") == std::string_view::npos ? 1.0f : -1.0f) {}

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
    check_point(stored, name_, "a corner of triangle", mesh_.triangles.size());
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

Mesh read_stl(const std::filesystem::path& path) {
  const std::string bytes = read_whole_file(path);
  // Some programs start their binary files with "solid" too; then only the size distinguishes them.
  std::uint32_t count = 0;
  if (bytes.size() >= kStlStart_B) std::memcpy(&count, bytes.data() + kStlHeader_B, sizeof count);
  const bool binary = bytes.size() == kStlStart_B + count * kStlTriangle_B || !bytes.starts_with("solid");
  return binary ? read_binary_stl(bytes, path.string()) : read_ascii_stl(bytes, path.string());
}

// ---- VTP ------------------------------------------------------------------------------------------------

void write_polys(const Mesh& mesh, const std::filesystem::path& path) {
  PolyData data;
  data.point_type = VtkType::kFloat32;
  data.points_mm.assign(mesh.points_mm.begin(), mesh.points_mm.end());
  for (const auto& triangle : mesh.triangles) data.polys.add(triangle);
  write_vtp(data, path);
}

Mesh read_polys(const std::filesystem::path& path) {
  const PolyData data = read_vtp(path);
  const std::string name = path.string();
  Mesh mesh;
  for (std::size_t i = 0; i < data.points_mm.size(); ++i) {
    check_point(data.points_mm[i], name, "Points: point", i);
    mesh.points_mm.emplace_back(data.points_mm[i]);
  }
  for (std::size_t i = 0; i < data.polys.size(); ++i) {
    const auto poly = data.polys[i];
    if (poly.size() < 3)
      throw InputError("{}: Polys: polygon {} has {}", path.string(), i, pluralize(poly.size(), "corner"));
    for (std::size_t k = 2; k < poly.size(); ++k) mesh.triangles.push_back({poly[0], poly[k - 1], poly[k]});
  }
  for (std::size_t i = 0; i < data.strips.size(); ++i) {
    const auto strip = data.strips[i];
    for (std::size_t k = 2; k < strip.size(); ++k)  // every other triangle of a strip runs backwards
      mesh.triangles.push_back({strip[k - 2 + k % 2], strip[k - 1 - k % 2], strip[k]});
  }
  return mesh;
}

}  // namespace

bool is_watertight(const Mesh& mesh) {
  std::vector<std::uint64_t> edges, reversed;
  for (const auto& triangle : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t from = triangle[k], to = triangle[(k + 1) % 3];
      if (from == to) return false;
      edges.push_back(from << 32 | to);
      reversed.push_back(to << 32 | from);
    }
  }
  std::ranges::sort(edges);
  std::ranges::sort(reversed);
  return edges == reversed && std::ranges::adjacent_find(edges) == edges.end();
}

double volume_mm3(const Mesh& mesh) {
  if (mesh.points_mm.empty()) return 0;
  const glm::dvec3 apex = mesh.points_mm.front();  // near the surface, against cancellation
  double sum = 0;
  for (const auto& [a, b, c] : mesh.triangles)
    sum += glm::dot(glm::dvec3(mesh.points_mm[a]) - apex,
                    glm::cross(glm::dvec3(mesh.points_mm[b]) - apex, glm::dvec3(mesh.points_mm[c]) - apex));
  return sum / 6;
}

void write_mesh(const Mesh& mesh, const std::filesystem::path& path) {
  const std::string extension = extension_of(path);
  if (extension == ".stl") return write_stl(mesh, path);
  if (extension == ".vtp") return write_polys(mesh, path);
  throw InputError("{}: a surface is written as .stl or .vtp, not \"{}\"", path.string(), extension);
}

Mesh read_mesh(const std::filesystem::path& path) {
  const std::string extension = extension_of(path);
  return with_remedy(path, "export the surface again as STL or VTP", [&] {
    if (extension == ".stl") return read_stl(path);
    if (extension == ".vtp") return read_polys(path);
    throw InputError("{}: a surface is read from .stl or .vtp, not \"{}\"", path.string(), extension);
  });
}

}  // namespace xraycast
