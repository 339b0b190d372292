#include "xraycast/drawing/surface_layer.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace xraycast {
namespace {

struct Vertex {
  glm::vec3 point_mm, normal, from_axis_mm;
};

/// Points with the area-weighted mean of their triangles' normals.
std::vector<Vertex> vertices_of(const Mesh& mesh, const Tube& tube) {
  std::vector<Vertex> vertices;
  for (const glm::vec3& point : mesh.points_mm) vertices.push_back({point, glm::vec3(0), glm::vec3(0)});
  for (std::size_t i = 0; i < tube.from_axis_mm.size(); ++i) vertices[i].from_axis_mm = tube.from_axis_mm[i];
  for (const auto& [a, b, c] : mesh.triangles) {
    const glm::vec3 normal =
        glm::cross(mesh.points_mm[b] - mesh.points_mm[a], mesh.points_mm[c] - mesh.points_mm[a]);
    for (const std::uint32_t corner : {a, b, c}) vertices[corner].normal += normal;
  }
  return vertices;
}

glm::dvec3 ray_origin_mm(const View& view) { return view.cone ? view.source_mm() : view.centre_mm; }

}  // namespace

SurfaceLayer::SurfaceLayer() : shaded_("surface.vert", "surface.frag") {}

void SurfaceLayer::set(std::span<const Surface> surfaces) {
  parts_.clear();
  for (const Surface& surface : surfaces) replace(parts_.size(), surface);
}

void SurfaceLayer::replace(std::size_t index, const Surface& surface) {
  if (index == parts_.size()) parts_.emplace_back();
  Part& part = parts_.at(index);
  part.surface = surface.mu_weights.empty() ? surface : Surface{};
  const Mesh& mesh = part.surface.mesh;
  part.colour = surface.colour;
  part.is_closed = is_watertight(mesh);
  part.front_faces = volume_mm3(mesh) < 0 ? GL_CW : GL_CCW;
  part.indices = static_cast<GLsizei>(3 * mesh.triangles.size());
  glBindVertexArray(part.vertices.id());
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, part.triangles.id());
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(part.indices * sizeof(std::uint32_t)),
               mesh.triangles.data(), GL_DYNAMIC_DRAW);
  glBindVertexArray(0);
  place(part);
}

void SurfaceLayer::move(std::size_t index, std::span<const glm::vec3> points_mm) {
  Part& part = parts_.at(index);
  if (part.indices == 0) return;  // left out
  part.surface.mesh.points_mm.assign(points_mm.begin(), points_mm.end());
  place(part);
}

/// What follows from a surface's points, on the GPU too.
void SurfaceLayer::place(Part& part) {
  part.tube = tube_of(part.surface);
  const std::vector<Vertex> vertices = vertices_of(part.surface.mesh, part.tube);
  glm::vec3 lower(0), upper(0);
  if (!vertices.empty()) lower = upper = vertices[0].point_mm;
  for (const Vertex& vertex : vertices) {
    lower = glm::min(lower, vertex.point_mm);
    upper = glm::max(upper, vertex.point_mm);
  }
  part.lower_mm = lower;
  part.upper_mm = upper;
  glBindVertexArray(part.vertices.id());
  glBindBuffer(GL_ARRAY_BUFFER, part.points.id());
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(vertices.size() * sizeof(Vertex)), vertices.data(),
               GL_DYNAMIC_DRAW);
  for (const GLuint attribute : {0u, 1u, 2u}) {
    glEnableVertexAttribArray(attribute);
    glVertexAttribPointer(
        attribute, 3, GL_FLOAT, GL_FALSE, sizeof(Vertex),
        // NOLINTNEXTLINE(performance-no-int-to-ptr): OpenGL takes offsets into a buffer as pointers.
        reinterpret_cast<const void*>(attribute * sizeof(glm::vec3)));
  }
  glBindVertexArray(0);
}

bool SurfaceLayer::empty() const {
  return std::ranges::all_of(parts_, [](const Part& part) { return part.indices == 0; });
}

ScreenBox SurfaceLayer::box(const View& view) const {
  ScreenBox box;
  for (const Part& part : parts_)
    if (part.indices > 0) box = united(box, drawn_box(part.tube, part.lower_mm, part.upper_mm, view));
  return box;
}

void SurfaceLayer::draw(const Part& part) const {
  glFrontFace(part.front_faces);
  glBindVertexArray(part.vertices.id());
  glDrawElements(GL_TRIANGLES, part.indices, GL_UNSIGNED_INT, nullptr);
  glFrontFace(GL_CCW);
}

void SurfaceLayer::draw_shaded(const View& view, DepthMeasure measure) const {
  constexpr float kFar = 1;
  glClearBufferfv(GL_DEPTH, 0, &kFar);
  glEnable(GL_DEPTH_TEST);
  glEnable(GL_DEPTH_CLAMP);
  glDepthFunc(GL_LESS);
  shaded_.use();
  const bool horizontal = measure == DepthMeasure::horizontal;
  shaded_.set("to_clip", to_clip(view));
  shaded_.set("towards_detector", view.towards_detector());
  shaded_.set("is_cone", view.cone.has_value());
  shaded_.set("origin_mm", ray_origin_mm(view));
  shaded_.set("along", horizontal ? glm::dvec3(std::sin(view.lao_rad), -std::cos(view.lao_rad), 0)
                                  : view.towards_detector());
  shaded_.set("counted_axes", horizontal ? glm::dvec3(1, 1, 0) : glm::dvec3(1));
  for (const Part& part : parts_) {
    shaded_.set("colour", part.colour);
    const Widening widening = widening_of(part.tube, part.lower_mm, part.upper_mm, view);
    shaded_.set("widening", widening.factor - 1);
    shaded_.set("thinness", widening.thinness);
    if (part.is_closed) glEnable(GL_CULL_FACE);
    draw(part);
    glDisable(GL_CULL_FACE);
  }
  glDisable(GL_DEPTH_CLAMP);
  glDisable(GL_DEPTH_TEST);
}

}  // namespace xraycast
