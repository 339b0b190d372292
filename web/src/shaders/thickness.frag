// The depth along the ray where it leaves a closed surface, and its negative where it enters: blended by addition, the length
// within. Red is times mu, green is of the surface that is outlined.
in vec3 position_mm, normal;
in float weight;
uniform vec3 origin_mm, towards_detector;  // a cone's source, or the view's centre
uniform bool is_cone;
uniform float mu_per_mm, outlined;
out vec4 sums;

void main() {
  vec3 offset = position_mm - origin_mm;
  float depth = is_cone ? length(offset) : dot(offset, towards_detector);
  sums = vec4(mu_per_mm * weight, outlined, 0.0, 0.0) * (gl_FrontFacing ? depth : -depth);
}
