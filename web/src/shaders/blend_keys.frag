// The texels of an instant: the sum of those of up to four key maps, bytes, by shares of 256ths, rounded as the program does.
uniform highp sampler2DArray key_0, key_1, key_2, key_3;  // quads of four rows x columns x layers
uniform vec4 shares, first_quads;                         // of the key maps
uniform int layer, sources;
uniform float offset, scale;  // of the layer's bytes
out vec4 texel;

vec4 bytes_of(highp sampler2DArray key, float first_quad) {
  return floor(255.0 * texelFetch(key, ivec3(int(gl_FragCoord.x) - int(first_quad), int(gl_FragCoord.y), layer), 0) + 0.5);
}

void main() {
  vec4 sum = shares.x * bytes_of(key_0, first_quads.x);
  if (sources > 1) sum += shares.y * bytes_of(key_1, first_quads.y);
  if (sources > 2) sum += shares.z * bytes_of(key_2, first_quads.z);
  if (sources > 3) sum += shares.w * bytes_of(key_3, first_quads.w);
  texel = offset + scale * floor((sum + 128.0) / 256.0);
}
