// Optical depth of a rectified view: a texel holds four rows of a column. Variant MAP_ROWS: the view's rows are the
// map's own.
#include "columns.glsl"
uniform int first_quad;
out vec4 tau;

// Of a column in a band.
vec4 sum_of(vec4 column, int quad) {
  int first = int(column.x), end = first + int(column.y);
  vec4 sum = vec4(0.0);
#ifdef MAP_ROWS
  int of_map = quad + first_quad;
  if (!meets_band(float(4 * of_map), float(4 * of_map + 3))) return sum;
  for (int i = first; i < end; ++i) {
    vec4 sample_ = texelFetch(sample_table, 2 * i);
    sum += sample_.y * quad_of(sample_, range_of(i), of_map);
  }
  return sum * share_of_band(of_map);
#else
  vec4 row = first_row + row_step * (float(4 * quad) + vec4(0.0, 1.0, 2.0, 3.0));
  vec4 slopes = slope_of(row, column.z);
  if (!rays_meet_band(column, row, slopes)) return sum;
  for (int i = first; i < end; ++i) {
    vec4 sample_ = texelFetch(sample_table, 2 * i), where = texelFetch(sample_table, 2 * i + 1);
    sum += sample_.y * rows_of(sample_, where, range_of(i), row, slopes);
  }
  return sum * secant(slopes);
#endif
}

void main() {
  tau = vec4(0.0);
  for (int band = 0; band < bands; ++band)
    tau += sum_of(column_in(band, int(gl_FragCoord.x)), int(gl_FragCoord.y));
}
