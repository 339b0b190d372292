// Optical depth between an opaque surface and the detector.
uniform highp sampler2D surface_depth, shade;  // s of the surface; under a cone, its horizontal distance from the source
uniform mat3 from_pixel;
uniform float view_height, last_column;
out vec4 tau;

// Of a column in a band: what lies nearer to the detector than `depth` of rays that cross the rectified plane in a row.
float sum_in_front(vec4 column, float row, float depth) {
  vec4 slopes = slope_of(vec4(row), column.z);
  if (!rays_meet_band(column, vec4(row), slopes)) return 0.0;
  float sum = 0.0;
  int first = int(column.x);
  for (int i = first + int(column.y) - 1; i >= first; --i) {
    vec4 sample_ = entry(sample_table, 2 * i), where = entry(sample_table, 2 * i + 1);
    if (where.z <= depth) break;  // this sample and all before it lie behind the surface
    float share = min(1.0, (where.z - depth) / max(where.z - where.y, 1e-6));
    where.y = max(where.y, depth);
    sum += share * sample_.y * rows_of(sample_, where, vec4(row), slopes).x;
  }
  return sum * secant(slopes).x;
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  if (texelFetch(shade, at, 0).a == 0.0) discard;
  vec3 place = from_pixel * vec3(gl_FragCoord.x, view_height - gl_FragCoord.y, 1.0);
  place.xy /= place.z;
  int of_column = int(clamp(floor(place.x + 0.5), 0.0, last_column));
  float row = first_row + row_step * place.y, depth = texelFetch(surface_depth, at, 0).x, sum = 0.0;
  for (int band = 0; band < bands; ++band) {
    vec4 column = column_in(band, of_column);
    sum += sum_in_front(column, row, column.z > 0.0 ? depth - 1.0 / column.z : depth);
  }
  tau = vec4(sum);
}
