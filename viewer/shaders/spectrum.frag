// Optical depth from the masses of three materials along the rays; a texel holds four rows.
#include "spectrum.glsl"
uniform sampler2D water, bone, iodine;
out vec4 tau;

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 w = texelFetch(water, at, 0), b = texelFetch(bone, at, 0), n = texelFetch(iodine, at, 0);
  for (int i = 0; i < 4; ++i) tau[i] = spectral_tau(max(vec3(w[i], b[i], n[i]), 0.0));
}
