// Optical depth by ray marching, pixel by pixel: a texel holds four rows of a column.
#include "march.glsl"
uniform float pixels_per_column;
out vec4 tau;

void main() {
  float column = floor(gl_FragCoord.x) * pixels_per_column + 0.5;
  float row = 4.0 * floor(gl_FragCoord.y) + 0.5;
  for (int i = 0; i < 4; ++i) tau[i] = march(ray_of(vec2(column, row + float(i))), -1e9);
}
