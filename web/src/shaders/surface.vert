layout(location = 0) in vec3 point_mm;
layout(location = 1) in vec3 point_normal;
layout(location = 2) in float point_weight;
uniform mat4 to_clip;
out vec3 position_mm, normal;
out float weight;

void main() {
  position_mm = point_mm;
  normal = point_normal;
  weight = point_weight;
  gl_Position = to_clip * vec4(point_mm, 1.0);
}
