// Optical depth of closed surfaces, by adding up: where a ray leaves minus where it enters.
in vec3 position_mm;
in vec3 normal;
flat in float mu_per_mm;
uniform bool is_cone;
uniform vec3 origin_mm;  // a cone's source, or the view's centre
uniform vec3 along;
uniform float distance_mm;  // of the view's centre, so that sums stay small
out float tau;

void main() {
  vec3 offset = position_mm - origin_mm;
  float depth = is_cone ? length(offset) - distance_mm : dot(offset, along);
  tau = mu_per_mm * (gl_FrontFacing ? depth : -depth);
}
