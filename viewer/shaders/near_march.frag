// Optical depth between an opaque surface and the detector, by ray marching.
#include "march.glsl"
uniform sampler2D surface_depth;  // along the ray
uniform float view_height;
out vec4 tau;

void main() {
  float depth = texelFetch(surface_depth, ivec2(gl_FragCoord.xy), 0).x;
  tau = vec4(march(ray_of(vec2(gl_FragCoord.x, view_height - gl_FragCoord.y)), depth));
}
