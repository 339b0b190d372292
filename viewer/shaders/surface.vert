layout(location = 0) in vec3 point_mm;
layout(location = 1) in vec3 point_normal;
layout(location = 2) in float point_mu_per_mm;
uniform mat4 to_clip;
out vec3 position_mm;
out vec3 normal;
flat out float mu_per_mm;

void main() {
  position_mm = point_mm;
  normal = point_normal;
  mu_per_mm = point_mu_per_mm;
  gl_Position = to_clip * vec4(point_mm, 1.0);
}
