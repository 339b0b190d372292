// Opaque surfaces, attenuated by the body in front of them. Variants: TAU (that body's optical depth), SPECTRUM.
uniform sampler2D shade, near_tau;
uniform float scale;
uniform bool inverted;
#ifdef TAU
out float result;
#else
out vec4 result;
#endif
#ifdef SPECTRUM
#include "spectrum.glsl"
#endif

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
#ifdef SPECTRUM
  float tau = spectral_tau(max(texelFetch(near_tau, at, 0).xyz, 0.0));
#else
  float tau = max(texelFetch(near_tau, at, 0).x, 0.0);
#endif
#ifdef TAU
  result = tau;
#else
  vec3 matter = vec3(inverted ? 1.0 : 0.0);
  result = vec4(mix(matter, texelFetch(shade, at, 0).rgb, exp(-tau / scale)), 1.0);
#endif
}
