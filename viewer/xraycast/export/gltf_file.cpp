#include "xraycast/export/gltf_file.hpp"

#include "xraycast/scene/catheter_surface.hpp"
#include "xraycast/scene/vessels.hpp"

#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <numbers>
#include <span>

namespace xraycast {
namespace {

using GltfJson = nlohmann::ordered_json;

// OpenGL's numbers, as glTF writes them.
enum : int {
  kLines = 1,
  kTriangles = 4,
  kUint32 = 5125,
  kFloat32 = 5126,
  kVertices = 34962,
  kIndices = 34963
};

/// From LPS millimetres to metres with +Y upwards.
glm::vec3 turned(const glm::vec3& lps) { return {lps.x, lps.z, -lps.y}; }
glm::vec3 in_metres(const glm::vec3& lps_mm) { return 1e-3f * turned(lps_mm); }

/// The area-weighted mean of the triangles' normals at every point; upwards where there is none.
std::vector<glm::vec3> unit_normals(const Mesh& mesh) {
  std::vector<glm::vec3> normals(mesh.points_mm.size(), glm::vec3(0));
  for (const auto& [a, b, c] : mesh.triangles) {
    const glm::vec3 normal =
        glm::cross(mesh.points_mm[b] - mesh.points_mm[a], mesh.points_mm[c] - mesh.points_mm[a]);
    for (const std::uint32_t corner : {a, b, c}) normals[corner] += normal;
  }
  for (glm::vec3& normal : normals) {
    const float length = glm::length(normal);
    normal = turned(length > 0 ? normal / length : glm::vec3(0, 0, 1));
  }
  return normals;
}

/// A glTF file as it grows: one buffer, and a node for each mesh.
class GltfScene {
 public:
  explicit GltfScene(const std::string& title) {
    json_["asset"] = {
        {"version", "2.0"}, {"generator", "xraycast"}, {"extras", {{"note", "Not for clinical use"}}}};
    json_["scene"] = 0;
    json_["scenes"] = {{{"name", title}, {"nodes", GltfJson::array()}}};
    for (const char* list : {"nodes", "meshes", "materials", "accessors", "bufferViews"})
      json_[list] = GltfJson::array();
  }

  void add(const std::string& name, const Mesh& mesh, const glm::dvec3& colour) {
    if (mesh.triangles.empty()) return;
    const std::span corners(mesh.triangles.front().data(), 3 * mesh.triangles.size());
    add_node(name,
             {{"attributes",
               {{"POSITION", add_points(mesh.points_mm)}, {"NORMAL", add_vectors(unit_normals(mesh))}}},
              {"indices", add_accessor(corners, kIndices, {{"componentType", kUint32}, {"type", "SCALAR"}},
                                       corners.size())},
              {"material", add_material(name, colour)},
              {"mode", kTriangles}});
  }

  void add_line(const std::string& name, const std::vector<glm::vec3>& ends_mm, const glm::dvec3& colour) {
    add_node(name, {{"attributes", {{"POSITION", add_points(ends_mm)}}},
                    {"material", add_material(name, colour)},
                    {"mode", kLines}});
  }

  /// The whole file: a header, the JSON and the buffer, each padded to four bytes.
  std::string bytes() {
    json_["buffers"] = {{{"byteLength", buffer_.size()}}};
    std::string text = json_.dump(-1, ' ', false, GltfJson::error_handler_t::replace);
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::string file = "glTF";
    append(file, 2u);
    append(file, static_cast<std::uint32_t>(12 + 8 + text.size() + 8 + buffer_.size()));
    append(file, static_cast<std::uint32_t>(text.size()));
    file += "JSON" + text;
    append(file, static_cast<std::uint32_t>(buffer_.size()));
    return file += std::string("BIN\0", 4) + buffer_;
  }

 private:
  static void append(std::string& file, std::uint32_t number) {
    static_assert(std::endian::native == std::endian::little);
    file.append(reinterpret_cast<const char*>(&number), sizeof number);
  }

  template <typename Value>
  int add_accessor(std::span<Value> values, int target, GltfJson accessor, std::size_t count) {
    json_["bufferViews"].push_back({{"buffer", 0},
                                    {"byteOffset", buffer_.size()},
                                    {"byteLength", values.size_bytes()},
                                    {"target", target}});
    buffer_.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
    accessor["bufferView"] = json_["bufferViews"].size() - 1;
    accessor["count"] = count;
    json_["accessors"].push_back(accessor);
    return static_cast<int>(json_["accessors"].size()) - 1;
  }

  int add_vectors(const std::vector<glm::vec3>& vectors, GltfJson accessor = {}) {
    accessor["componentType"] = kFloat32;
    accessor["type"] = "VEC3";
    return add_accessor(std::span(vectors), kVertices, accessor, vectors.size());
  }

  int add_points(const std::vector<glm::vec3>& points_mm) {
    std::vector<glm::vec3> points;
    glm::vec3 low(in_metres(points_mm.front())), high = low;
    for (const glm::vec3& point_mm : points_mm) {
      points.push_back(in_metres(point_mm));
      low = glm::min(low, points.back());
      high = glm::max(high, points.back());
    }
    return add_vectors(points, {{"min", {low.x, low.y, low.z}}, {"max", {high.x, high.y, high.z}}});
  }

  int add_material(const std::string& name, const glm::dvec3& colour) {
    json_["materials"].push_back({{"name", name},
                                  {"doubleSided", true},
                                  {"pbrMetallicRoughness",
                                   {{"baseColorFactor", {colour.x, colour.y, colour.z, 1}},
                                    {"metallicFactor", 0},
                                    {"roughnessFactor", 0.6}}}});
    return static_cast<int>(json_["materials"].size()) - 1;
  }

  void add_node(const std::string& name, const GltfJson& primitive) {
    json_["meshes"].push_back({{"name", name}, {"primitives", GltfJson::array({primitive})}});
    json_["nodes"].push_back({{"name", name}, {"mesh", json_["meshes"].size() - 1}});
    json_["scenes"][0]["nodes"].push_back(json_["nodes"].size() - 1);
  }

  GltfJson json_;
  std::string buffer_;
};

/// A box about a point, its edges along `right`, `up` and `n`.
void add_box(Mesh& mesh, const View& pose, const glm::dvec3& middle_mm, const glm::dvec3& half_mm) {
  const std::array<glm::dvec3, 3> along{pose.right(), pose.up(), pose.towards_detector()};
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0}) {
      // Four corners of a face; `u` x `v` points outwards.
      const glm::dvec3 face = middle_mm + side * half_mm[axis] * along[static_cast<std::size_t>(axis)];
      const int next = (axis + 1) % 3, after = (axis + 2) % 3;
      const glm::dvec3 u = side * half_mm[next] * along[static_cast<std::size_t>(next)],
                       v = half_mm[after] * along[static_cast<std::size_t>(after)];
      const auto corner = static_cast<std::uint32_t>(mesh.points_mm.size());
      for (const glm::dvec3& point : {face - u - v, face + u - v, face + u + v, face - u + v})
        mesh.points_mm.emplace_back(point);
      mesh.triangles.push_back({corner, corner + 1, corner + 2});
      mesh.triangles.push_back({corner, corner + 2, corner + 3});
    }
}

/// Source, detector, and the arc that joins them around the head's side.
Mesh c_arm_mesh(const View& pose) {
  constexpr Cone kUsual{780, 1200};
  constexpr double kTube_mm = 35;
  constexpr int kPoints = 48;
  const Cone cone = pose.cone.value_or(kUsual);
  const glm::dvec3 n = pose.towards_detector(), source_mm = pose.centre_mm - cone.source_axis_mm * n,
                   detector_mm = source_mm + cone.source_detector_mm * n;
  const double radius_mm = 0.5 * cone.source_detector_mm;
  const glm::dvec3 middle_mm = 0.5 * (source_mm + detector_mm);
  VesselBranch arc;
  for (int i = 0; i <= kPoints; ++i) {
    const double angle = std::numbers::pi * i / kPoints;
    arc.points.push_back(
        {middle_mm + radius_mm * (std::cos(angle) * n + std::sin(angle) * pose.up()), kTube_mm});
  }
  Mesh mesh = tube_mesh(VesselTree({std::move(arc)}, "C-arm"));
  add_box(mesh, pose, detector_mm, {200, 200, 30});
  add_box(mesh, pose, source_mm, {90, 90, 120});
  return mesh;
}

/// Where a run's instruments end.
void add_instruments(const RecordedRun& run, GltfScene& scene) {
  for (const RecordedRun::Instrument& instrument : run.instruments) {
    const std::vector<InstrumentPart> parts = instrument_parts(instrument.look);
    for (std::size_t p = 0; p < parts.size(); ++p)
      if (const std::vector<glm::dvec3>& controls_mm = instrument.parts[p].back(); !controls_mm.empty()) {
        const NurbsCurve curve = NurbsCurve::cubic(controls_mm, instrument.name);
        scene.add(p == 0 ? instrument.name : instrument.name + ", marker " + std::to_string(p),
                  p == 0 ? tube_mesh(curve, instrument.look.radius_mm)
                         : band_mesh(curve, instrument.look.radius_mm, parts[p].inner_radius_mm),
                  parts[p].colour);
      }
  }
}

}  // namespace

std::string gltf_binary(const ExportRequest& session) {
  GltfScene scene(session.title);
  if (session.vessels) scene.add("vessels", session.vessels->mesh, session.vessels->colour);
  for (const Surface& catheter : session.catheters) scene.add("catheter", catheter.mesh, catheter.colour);
  for (const Surface& implant : session.implants) scene.add("object", implant.mesh, implant.colour);
  if (session.run) add_instruments(*session.run, scene);
  const BodyBounds bounds = bounds_of(session.map->geometry);
  const glm::dvec3 half_mm(0, 0, bounds.half_height_mm);
  scene.add_line("axis", {glm::vec3(bounds.centre_mm - half_mm), glm::vec3(bounds.centre_mm + half_mm)},
                 {0.9, 0.7, 0.2});
  scene.add("C-arm", c_arm_mesh(view_of(session.pose, bounds, 1, 1)), {0.7, 0.72, 0.75});
  return scene.bytes();
}

}  // namespace xraycast
