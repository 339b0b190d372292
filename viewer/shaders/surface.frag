// Opaque surfaces: their shaded colour, and their depth along the ray.
in vec3 position_mm;
in vec3 normal;
uniform vec3 colour, towards_detector;
uniform float thinness;     // of a tube: 1 where it is thinner than a pixel
uniform bool is_cone;
uniform vec3 origin_mm;     // a cone's source, or the view's centre
uniform vec3 along;         // of a parallel beam: the direction in which depth is measured
uniform vec3 counted_axes;  // 1 where an axis counts for the distance from a source
layout(location = 0) out vec4 shade;
layout(location = 1) out float depth;

void main() {
  // Lambertian, lit by a headlight at the detector, with an ambient term.
  // A pixel sees a thin tube's whole width, of which the mean is pi / 4.
  float lambert = mix(abs(dot(normalize(normal), towards_detector)), 0.785, thinness);
  shade = vec4(colour * (0.25 + 0.75 * lambert), 1.0);
  vec3 offset = position_mm - origin_mm;
  depth = is_cone ? length(offset * counted_axes) : dot(offset, along);
}
