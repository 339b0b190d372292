layout(location = 0) in vec3 point_mm;
layout(location = 1) in vec3 point_normal;
layout(location = 2) in vec3 from_axis_mm;  // of a tube; 0 on other surfaces
uniform mat4 to_clip;
uniform float widening;  // of a tube that is thinner than a pixel, over its radius
out vec3 position_mm;
out vec3 normal;

void main() {
  position_mm = point_mm + widening * from_axis_mm;
  normal = point_normal;
  gl_Position = to_clip * vec4(position_mm, 1.0);
}
