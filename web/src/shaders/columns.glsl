// The map along the rays of a rectified view's columns, after viewer/shaders/columns.glsl.
uniform highp sampler2DArray map_texels;  // quads of four rows x columns x layers
uniform highp sampler2D column_table, sample_table;  // kTableWidth texels a row
uniform float quads, map_rows;
uniform float first_row, row_step;  // the map row of a picture's row
uniform float slope;                // of a parallel beam: map rows per mm of s
uniform float source_row, row_mm;
uniform bool blends_layers;

vec4 entry(highp sampler2D table, int i) { return texelFetch(table, ivec2(i & 1023, i >> 10), 0); }

// Four rows of the map, interpolated between the columns and layers of a sample.
vec4 quad_of(vec4 sample_, int quad) {
  int place = int(sample_.x), column = place & 2047, layer = place >> 11;
  vec4 values = mix(texelFetch(map_texels, ivec3(quad, column, layer), 0),
                    texelFetch(map_texels, ivec3(quad, column + 1, layer), 0), sample_.z);
  if (!blends_layers) return values;
  vec4 next = mix(texelFetch(map_texels, ivec3(quad, column, layer + 1), 0),
                  texelFetch(map_texels, ivec3(quad, column + 1, layer + 1), 0), sample_.z);
  return mix(values, next, sample_.w);
}

vec4 slope_of(vec4 row, float per_run_mm) { return slope + (row - source_row) * per_run_mm; }

// Length of the ray per mm of s.
vec4 secant(vec4 rows_per_mm) {
  vec4 rise = rows_per_mm * row_mm;
  return sqrt(1.0 + rise * rise);
}

// The map of a sample in four rows, which ascend and are no farther apart than the map's.
vec4 rows_of(vec4 sample_, vec4 row) {
  vec4 within = clamp(row, 0.0, map_rows - 1.0);
  int quad = int(within.x) / 4;
  vec4 upper = quad_of(sample_, quad), lower = quad_of(sample_, min(quad + 1, int(quads) - 1));
  return rows_of_quads(upper, lower, quad, row, within, map_rows);
}
