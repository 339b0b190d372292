// The map along the rays of a rectified view's columns (column_samples.hpp). Variants: BLENDS_LAYERS where samples
// lie between two layers, PATH where they stand for a length, BYTES where texels are bytes, BANDS where rows of the
// map have several outlines, and the columns samples of their own for each band of rows.
uniform samplerBuffer map_texels;    // four rows per texel (map_texels.hpp)
uniform samplerBuffer column_table;  // ColumnSamples::Column, of one band behind those of the other
uniform samplerBuffer sample_table;  // ColumnSample, two texels each
#ifdef BYTES
uniform samplerBuffer byte_ranges;   // offset and scale of a layer and of the next one
#endif
uniform int quads, layer_stride;     // of the map, in texels
uniform float map_rows;

// The map row in which rays cross the rectified plane is first_row + row_step * row of the picture.
uniform float first_row, row_step;
uniform float slope;       // of a parallel beam: map rows per mm of s
uniform float source_row;  // of a cone
uniform float row_mm;

#ifdef BANDS
uniform samplerBuffer band_table;  // the first and the last row of each band
uniform int bands, columns;        // their numbers
vec2 band_rows;                    // of the band whose samples are taken
bool leaves_band;                  // see meets_band
#else
const int bands = 1;
#endif

// A column's samples in a band.
vec4 column_in(int band, int column) {
#ifdef BANDS
  band_rows = texelFetch(band_table, band).xy;
  return texelFetch(column_table, band * columns + column);
#else
  return texelFetch(column_table, column);
#endif
}

// Whether these ascending rows of the map meet the band, between them what is interpolated; and whether some are not its
// own.
bool meets_band(float upper, float lower) {
#ifdef BANDS
  leaves_band = upper < band_rows.x || lower > band_rows.y;
  return lower > band_rows.x - 1.0 && upper < band_rows.y + 1.0;
#else
  return true;
#endif
}

// The same of a column's rays, which cross the rectified plane in these ascending rows.
bool rays_meet_band(vec4 column, vec4 row, vec4 slopes) {
#ifdef BANDS
  if (column.y == 0.0) return false;
  float from_mm = texelFetch(sample_table, 2 * int(column.x) + 1).y;
  float to_mm = texelFetch(sample_table, 2 * int(column.x + column.y) - 1).z;
  vec4 at_from = row + slopes * from_mm, at_to = row + slopes * to_mm;
  return meets_band(min(at_from.x, at_to.x), max(at_from.w, at_to.w));
#else
  return true;
#endif
}

// Of the four rows of a quad, 1 for those of the band and 0 for others.
vec4 share_of_band(int quad) {
#ifdef BANDS
  vec4 row = float(4 * quad) + vec4(0.0, 1.0, 2.0, 3.0);
  return step(band_rows.x, row) * step(row, vec4(band_rows.y));
#else
  return vec4(1.0);
#endif
}

#ifdef BANDS
// How much of a sample of the band counts, for which rays pass `reach` rows of the map to both sides of `middle`.
vec4 share_of_rows(vec4 middle, vec4 reach) {
  return clamp((min(middle + reach, band_rows.y + 0.5) - max(middle - reach, band_rows.x - 0.5)) / (2.0 * reach), 0.0, 1.0);
}
#endif

// What the bytes of a sample's layers stand for.
vec4 range_of(int sample_index) {
#ifdef BYTES
  return texelFetch(byte_ranges, int(texelFetch(sample_table, 2 * sample_index + 1).w));
#else
  return vec4(0.0);
#endif
}

// Four rows of the map, interpolated between the columns and layers of a sample.
vec4 quad_of(vec4 sample_, vec4 range, int quad) {
  int at = int(sample_.x) * quads + quad;
  vec4 values = mix(texelFetch(map_texels, at), texelFetch(map_texels, at + quads), sample_.z);
#ifdef BYTES
  values = range.x + range.y * values;
#endif
#ifdef BLENDS_LAYERS
  at += layer_stride;
  vec4 next = mix(texelFetch(map_texels, at), texelFetch(map_texels, at + quads), sample_.z);
#ifdef BYTES
  next = range.z + range.w * next;
#endif
  values = mix(values, next, sample_.w);
#endif
  return values;
}

// Map rows per mm of s of the rays that cross the rectified plane in these rows.
vec4 slope_of(vec4 row, float per_run_mm) { return slope + (row - source_row) * per_run_mm; }

// Length of the ray per mm of s: the secant of its elevation.
vec4 secant(vec4 rows_per_mm) {
#ifdef PATH
  vec4 rise = rows_per_mm * row_mm;
  return sqrt(1.0 + rise * rise);
#else
  return vec4(1.0);
#endif
}

#include "row_steps.glsl"

// The map of a sample, whose place is `where`, along four rays with these slopes. They cross the rectified plane in rows
// that ascend and are no farther apart than the map's.
vec4 rows_of(vec4 sample_, vec4 where, vec4 range, vec4 row, vec4 slopes) {
#ifdef BANDS
  vec4 middle = row + slopes * (0.5 * (where.y + where.z));
#endif
  row += slopes * where.x;
  vec4 within = clamp(row, 0.0, map_rows - 1.0);
#ifdef BANDS
  if (leaves_band) within = clamp(within, band_rows.x, band_rows.y);
#endif
  int quad = int(within.x) / 4;
  vec4 upper = quad_of(sample_, range, quad), lower = quad_of(sample_, range, min(quad + 1, quads - 1));
  vec4 values = rows_of_quads(upper, lower, quad, row, within, map_rows);
#ifdef BANDS
  if (leaves_band) values *= share_of_rows(middle, 0.5 * max(vec4(1.0), abs(slopes) * (where.z - where.y)));
#endif
  return values;
}
