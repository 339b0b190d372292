// The map along the rays of a rectified view's columns, after viewer/shaders/columns.glsl.
uniform highp sampler2DArray map_texels;  // quads of four rows x columns x layers
uniform highp sampler2D column_table, sample_table;  // kTableWidth texels a row
uniform float quads, map_rows;
uniform float first_row, row_step;  // the map row of a picture's row
uniform float slope;                // of a parallel beam: map rows per mm of s
uniform float source_row, row_mm;
uniform bool blends_layers;

// Bands of the map's rows that share an outline, each with samples of its own.
uniform int bands, columns;     // their number, and that of the picture's columns
uniform vec2 rows_of_bands[8];  // the first and the last row of each
vec2 band_rows;                 // of the band whose samples are taken
bool leaves_band;               // see meets_band

vec4 entry(highp sampler2D table, int i) { return texelFetch(table, ivec2(i & 1023, i >> 10), 0); }

// A column's samples in a band.
vec4 column_in(int band, int column) {
  band_rows = rows_of_bands[band];
  return entry(column_table, band * columns + column);
}

// Whether these ascending rows of the map meet the band, between them what is interpolated; and whether some are not its
// own.
bool meets_band(float upper, float lower) {
  leaves_band = upper < band_rows.x || lower > band_rows.y;
  return lower > band_rows.x - 1.0 && upper < band_rows.y + 1.0;
}

// The same of a column's rays, which cross the rectified plane in these ascending rows.
bool rays_meet_band(vec4 column, vec4 row, vec4 slopes) {
  leaves_band = false;
  if (bands == 1) return true;
  if (column.y == 0.0) return false;
  float from_mm = entry(sample_table, 2 * int(column.x) + 1).y;
  float to_mm = entry(sample_table, 2 * int(column.x + column.y) - 1).z;
  vec4 at_from = row + slopes * from_mm, at_to = row + slopes * to_mm;
  return meets_band(min(at_from.x, at_to.x), max(at_from.w, at_to.w));
}

// Of the four rows of a quad, 1 for those of the band and 0 for others.
vec4 share_of_band(int quad) {
  vec4 row = float(4 * quad) + vec4(0.0, 1.0, 2.0, 3.0);
  return step(band_rows.x, row) * step(row, vec4(band_rows.y));
}

// How much of a sample of the band counts, for which rays pass `reach` rows of the map to both sides of `middle`.
vec4 share_of_rows(vec4 middle, vec4 reach) {
  return clamp((min(middle + reach, band_rows.y + 0.5) - max(middle - reach, band_rows.x - 0.5)) / (2.0 * reach), 0.0, 1.0);
}

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

// The map of a sample, whose place is `where`, along four rays with these slopes. They cross the rectified plane in rows
// that ascend and are no farther apart than the map's.
vec4 rows_of(vec4 sample_, vec4 where, vec4 row, vec4 slopes) {
  vec4 middle = row + slopes * (0.5 * (where.y + where.z));
  row += slopes * where.x;
  vec4 within = clamp(row, 0.0, map_rows - 1.0);
  if (leaves_band) within = clamp(within, band_rows.x, band_rows.y);
  int quad = int(within.x) / 4;
  vec4 upper = quad_of(sample_, quad), lower = quad_of(sample_, min(quad + 1, int(quads) - 1));
  vec4 values = rows_of_quads(upper, lower, quad, row, within, map_rows);
  return leaves_band ? values * share_of_rows(middle, 0.5 * max(vec4(1.0), abs(slopes) * (where.z - where.y))) : values;
}
