// Half the rows of a map, each the mean of two.
uniform highp sampler2DArray map_texels;  // quads of four rows x columns x layers
uniform int layer, last_quad;
out vec4 texel;

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 upper = texelFetch(map_texels, ivec3(2 * at.x, at.y, layer), 0);
  vec4 lower = 2 * at.x < last_quad ? texelFetch(map_texels, ivec3(2 * at.x + 1, at.y, layer), 0) : upper.wwww;
  texel = 0.5 * vec4(upper.x + upper.y, upper.z + upper.w, lower.x + lower.y, lower.z + lower.w);
}
