// Optical depth of a rectified view: a texel holds four rows of a column.
uniform int first_quad;
uniform bool has_map_rows;  // the view's rows are the map's own
out vec4 tau;

void main() {
  int quad = int(gl_FragCoord.y);
  vec4 column = entry(column_table, int(gl_FragCoord.x));
  int first = int(column.x), end = first + int(column.y);
  vec4 sum = vec4(0.0);
  if (has_map_rows) {
    for (int i = first; i < end; ++i) {
      vec4 sample_ = entry(sample_table, 2 * i);
      sum += sample_.y * quad_of(sample_, quad + first_quad);
    }
    tau = sum;
    return;
  }
  vec4 row = first_row + row_step * (float(4 * quad) + vec4(0.0, 1.0, 2.0, 3.0));
  vec4 slopes = slope_of(row, column.z);
  for (int i = first; i < end; ++i) {
    vec4 sample_ = entry(sample_table, 2 * i);
    float s_mm = entry(sample_table, 2 * i + 1).x;
    sum += sample_.y * rows_of(sample_, row + slopes * s_mm);
  }
  tau = sum * secant(slopes);
}
